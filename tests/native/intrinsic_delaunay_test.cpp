// SPDX-License-Identifier: GPL-3.0-or-later
#include "systems/intrinsic_delaunay.h"

#include <Eigen/Dense>
#include <set>

#include "catch.h"
#include "dense_reference.h"
#include "systems/operators.h"
#include "triangulations.h"

using namespace dd;

namespace {

Mesh jittered_sheet(int columns, int rows) {
  Mesh mesh = test::grid(columns, rows, [](double, double) { return 0.0; });
  std::mt19937 random(4);
  std::uniform_real_distribution<double> jitter(-0.3, 0.3);
  for (int i = 1; i + 1 < columns; ++i)
    for (int j = 1; j + 1 < rows; ++j)
      mesh.positions.row(i * rows + j).head<2>() +=
          Eigen::RowVector2d(jitter(random) / columns, jitter(random) / rows);
  return mesh;
}

/// L after every obtuse edge was flipped, without the margin kObtuse.
Eigen::MatrixXd strict_laplacian(const Mesh& mesh) {
  const IntrinsicTriangles intrinsic = intrinsic_delaunay(mesh.positions, mesh.triangles, -1e-9);
  const int n = mesh.vertex_count();
  Eigen::MatrixXd L = Eigen::MatrixXd::Zero(n, n);
  for (Index j = 0; j < intrinsic.triangles.rows(); ++j)
    for (int k = 0; k < 3; ++k) {
      // Another formula than the core's: the angle by the law of cosines.
      const double a = intrinsic.lengths(j, k), b = intrinsic.lengths(j, (k + 1) % 3),
                   c = intrinsic.lengths(j, (k + 2) % 3);
      const double w = 0.5 / std::tan(std::acos((b * b + c * c - a * a) / (2 * b * c)));
      const int u = intrinsic.triangles(j, (k + 1) % 3), v = intrinsic.triangles(j, (k + 2) % 3);
      L(u, u) += w, L(v, v) += w, L(u, v) -= w, L(v, u) -= w;
    }
  return L;
}

/// The Laplacian of points in the plane by the definition: its triangles are those whose
/// circumcircles have no other point inside.
Eigen::MatrixXd empty_circle_laplacian(const Positions& p) {
  std::vector<Eigen::RowVector3i> found;
  const int n = static_cast<int>(p.rows());
  for (int a = 0; a < n; ++a)
    for (int b = a + 1; b < n; ++b)
      for (int c = b + 1; c < n; ++c) {
        const Eigen::Vector2d origin = p.row(a).head<2>();
        Eigen::Matrix2d edges;
        edges << p.row(b).head<2>() - origin.transpose(), p.row(c).head<2>() - origin.transpose();
        if (std::abs(edges.determinant()) < 1e-12) continue;
        const Eigen::Vector2d centre = edges.inverse() * edges.rowwise().squaredNorm() / 2;
        const auto is_inside = [&](int v) {
          return (p.row(v).head<2>().transpose() - origin - centre).norm() < centre.norm() - 1e-9;
        };
        int v = 0;
        while (v < n && !is_inside(v)) ++v;
        if (v == n) found.emplace_back(a, b, c);
      }
  Triangles t(Index(found.size()), 3);
  for (size_t j = 0; j < found.size(); ++j) t.row(Index(j)) = found[j];
  return test::dense_operators(p, t).L;
}

std::set<std::pair<int, int>> border_of(const Mesh& mesh) {
  std::set<std::pair<int, int>> once;
  for (Index k = 0; k < mesh.triangles.size(); ++k) {
    const auto edge = std::minmax(mesh.triangles(k / 3, k % 3), mesh.triangles(k / 3, (k + 1) % 3));
    if (!once.insert(edge).second) once.erase(edge);
  }
  return once;
}

double largest_weight_against(const Mesh& mesh, const Eigen::MatrixXd& L) {
  const auto border = border_of(mesh);
  double largest = 0;
  for (int u = 0; u < mesh.vertex_count(); ++u)
    for (int v = u + 1; v < mesh.vertex_count(); ++v)
      if (!border.count({u, v})) largest = std::max(largest, L(u, v));
  return largest;
}

double area(const IntrinsicTriangles& intrinsic) {
  double sum = 0;
  for (Index j = 0; j < intrinsic.lengths.rows(); ++j) {
    const auto l = intrinsic.lengths.row(j);
    sum += 0.5 * l[0] * triangle_apex(l[0], l[1], l[2]).height;
  }
  return sum;
}

bool same_operators(const SurfaceOperators& a, const SurfaceOperators& b) {
  return a.triangles == b.triangles && a.metric.cotangents == b.metric.cotangents &&
         a.metric.areas == b.metric.areas && a.masses == b.masses &&
         Eigen::MatrixXd(a.laplacian) == Eigen::MatrixXd(b.laplacian);
}

}  // namespace

TEST_CASE("DELAUNAY: the Laplacian of points in a plane is the same from any triangles") {
  const Mesh mesh = jittered_sheet(12, 9);
  const Eigen::MatrixXd L = strict_laplacian(mesh);
  CHECK(largest_weight_against(mesh, L) < 1e-9);
  for (unsigned seed : {1, 2, 3}) {
    const Mesh slivers = test::with_slivers(mesh, 1e-6, seed);
    REQUIRE(slivers.triangles != mesh.triangles);
    const Eigen::MatrixXd given = test::dense_operators(slivers.positions, slivers.triangles).L;
    CHECK(largest_weight_against(slivers, given) > 1);
    CHECK((strict_laplacian(slivers) - L).cwiseAbs().maxCoeff() < 1e-9);
  }
}

TEST_CASE("DELAUNAY: a sheet that is folded along its edges has the Laplacian of the flat one") {
  // Folded along the columns 4 and 8, which are made straight so that no triangle crosses a fold.
  // Beside column 4 vertices are so close to the middles of its edges that these are obtuse.
  Mesh straight = jittered_sheet(12, 9);
  for (int i : {4, 8})
    for (int j = 0; j < 9; ++j) straight.positions.row(i * 9 + j) << i / 11.0, j / 8.0, 0;
  for (int j = 1; j < 8; ++j) {
    straight.positions.row(3 * 9 + j) << 4 / 11.0 - 0.02, (j + 0.5) / 8, 0;
    straight.positions.row(5 * 9 + j) << 4 / 11.0 + 0.02, (j - 0.5) / 8, 0;
  }
  Mesh folded = straight;
  for (Index v = 0; v < folded.positions.rows(); ++v) {
    const double beyond = folded.positions(v, 0) - 4 / 11.0,
                 far = folded.positions(v, 0) - 8 / 11.0;
    if (far > 0)
      folded.positions.row(v) << 4 / 11.0, folded.positions(v, 1), 4 / 11.0 - far;
    else if (beyond > 0)
      folded.positions.row(v) << 4 / 11.0, folded.positions(v, 1), beyond;
  }
  // The flat one has that of the Delaunay triangulation, with edges across the fold.
  const Eigen::MatrixXd L = empty_circle_laplacian(straight.positions);
  CHECK((strict_laplacian(straight) - L).cwiseAbs().maxCoeff() < 1e-9);
  CHECK((strict_laplacian(folded) - L).cwiseAbs().maxCoeff() < 1e-9);
  CHECK(L.block(3 * 9, 5 * 9, 9, 9).minCoeff() < -0.5);
}

TEST_CASE("DELAUNAY: the operators keep the area and have no weight below the margin") {
  for (const Mesh& mesh : {test::rough_sphere(3, 0.25), test::with_slivers(test::sphere(3), 0.4),
                           test::with_slivers(test::bumpy_plane(21, 3), 0.3)}) {
    const auto given = surface_operators(mesh.positions, mesh.triangles);
    const auto made = surface_operators(mesh.positions, mesh.triangles, Triangulation::delaunay);
    REQUIRE(made.flipped);
    CHECK(made.metric.areas.sum() == Approx(given.metric.areas.sum()).epsilon(1e-12));
    CHECK(made.masses.sum() == Approx(given.masses.sum()).epsilon(1e-12));
    const IntrinsicTriangles intrinsic = intrinsic_delaunay(mesh.positions, mesh.triangles);
    CHECK(area(intrinsic) == Approx(given.metric.areas.sum()).epsilon(1e-12));
    const Eigen::MatrixXd L = made.laplacian;
    CHECK(largest_weight_against(mesh, L) <= -0.5 * kObtuse + 1e-12);
    CHECK((L * Eigen::VectorXd::Ones(L.rows())).cwiseAbs().maxCoeff() < 1e-11);
    // Triangles differ only where an edge was flipped.
    for (Index j = 0; j < mesh.triangles.rows(); ++j)
      if (!intrinsic.flipped[j]) {
        CHECK(made.triangles.row(j) == mesh.triangles.row(j));
        CHECK(made.metric.cotangents.row(j) == given.metric.cotangents.row(j));
      }
    // L p = div(G I) on flipped triangles, too: identity gradients give the surface itself.
    const Positions flux = corner_divergence(made.metric, mesh.positions, made.triangles);
    Positions sum = Positions::Zero(mesh.vertex_count(), 3);
    for (Index k = 0; k < flux.rows(); ++k) sum.row(made.triangles(k / 3, k % 3)) += flux.row(k);
    CHECK((sum - made.laplacian * mesh.positions).cwiseAbs().maxCoeff() < 1e-12);
  }
}

TEST_CASE("DELAUNAY: a regular grid stays as it is, rounded to floats, turned and scaled") {
  Mesh mesh = test::grid(60, 40, [](double, double) { return 0.0; });
  const test::Affine turn = test::rotation_about(0.7, {1, 2, 3}, {0, 0, 0}, {0.3, 0.2, 0.1});
  const Positions turned = test::transformed(turn, mesh.positions).cast<float>().cast<double>();
  for (double scale : {1e-4, 1.0, 1e4}) {
    const Positions scaled = scale * turned;
    CHECK(intrinsic_delaunay(scaled, mesh.triangles).flips == 0);
    const auto made = surface_operators(scaled, mesh.triangles, Triangulation::delaunay);
    CHECK(!made.flipped);
    CHECK(same_operators(made, surface_operators(scaled, mesh.triangles)));
  }
}

TEST_CASE("DELAUNAY: neither numbering nor size nor winding changes the Laplacian") {
  const Mesh mesh = test::with_slivers(test::rough_sphere(3, 0.1), 0.5);
  const Eigen::MatrixXd L =
      surface_operators(mesh.positions, mesh.triangles, Triangulation::delaunay).laplacian;
  const auto other =
      test::renumbered(mesh, std::vector<int>(static_cast<size_t>(mesh.vertex_count()), kFree));
  const Eigen::MatrixXd renumbered =
      surface_operators(other.mesh.positions, other.mesh.triangles, Triangulation::delaunay)
          .laplacian;
  CHECK((renumbered(other.new_of_old, other.new_of_old) - L).cwiseAbs().maxCoeff() < 1e-9);

  const test::Affine turn = test::rotation_about(0.7, {1, 2, 3}, {0, 0, 0}, {0.3, 0.2, 0.1});
  for (double scale : {1e-4, 1e4}) {
    const Positions moved = scale * test::transformed(turn, mesh.positions);
    const Eigen::MatrixXd same =
        surface_operators(moved, mesh.triangles, Triangulation::delaunay).laplacian;
    CHECK((same - L).cwiseAbs().maxCoeff() < 1e-9);
  }
  Mesh mixed = mesh;
  for (Index j = 0; j < mixed.triangles.rows(); j += 3)
    std::swap(mixed.triangles(j, 0), mixed.triangles(j, 1));
  const Eigen::MatrixXd same =
      surface_operators(mixed.positions, mixed.triangles, Triangulation::delaunay).laplacian;
  CHECK((same - L).cwiseAbs().maxCoeff() < 1e-9);
}

TEST_CASE(
    "DELAUNAY: vertices on edges of others, closed by triangles without area, keep L linear") {
  // A vertex in the middle of every third edge, joined to one side only: on the other side a
  // triangle without area closes the gap.
  Mesh mesh = jittered_sheet(14, 11);
  const int n = mesh.vertex_count(), m = mesh.triangle_count();
  std::vector<Eigen::RowVector3d> points;
  std::vector<Eigen::RowVector3i> faces;
  const auto border = border_of(mesh);
  for (int j = 0; j < m; ++j) {
    const int a = mesh.triangles(j, 0), b = mesh.triangles(j, 1), c = mesh.triangles(j, 2);
    if (j % 3 != 0 || border.count(std::minmax(a, b))) continue;
    const int middle = n + static_cast<int>(points.size());
    points.push_back(0.5 * (mesh.positions.row(a) + mesh.positions.row(b)));
    mesh.triangles.row(j) << a, middle, c;
    faces.emplace_back(middle, b, c);
    faces.emplace_back(a, b, middle);
  }
  mesh.positions.conservativeResize(n + Index(points.size()), 3);
  for (size_t i = 0; i < points.size(); ++i) mesh.positions.row(n + Index(i)) = points[i];
  mesh.triangles.conservativeResize(m + Index(faces.size()), 3);
  for (size_t i = 0; i < faces.size(); ++i) mesh.triangles.row(m + Index(i)) = faces[i];

  const auto given = surface_operators(mesh.positions, mesh.triangles);
  const auto made = surface_operators(mesh.positions, mesh.triangles, Triangulation::delaunay);
  CHECK(made.metric.degenerate.size() == points.size());
  const Eigen::MatrixXd residual = made.laplacian * mesh.positions;
  const auto edges = border_of(mesh);
  std::set<int> at_border;
  for (const auto& [u, v] : edges) at_border.insert(u), at_border.insert(v);
  for (int v = 0; v < mesh.vertex_count(); ++v)
    if (!at_border.count(v)) CHECK(residual.row(v).cwiseAbs().maxCoeff() < 1e-6);
  CHECK(largest_weight_against(mesh, given.laplacian) > 100);
  CHECK(largest_weight_against(mesh, made.laplacian) <= -0.5 * kObtuse + 1e-9);
}

TEST_CASE("DELAUNAY: flips of a triangle soup come to an end, and its operators are finite") {
  Mesh mesh = test::with_slivers(test::junction().mesh, 0.3);
  const Index n = mesh.positions.rows(), m = mesh.triangles.rows();
  mesh.positions.conservativeResize(n + 3, 3);
  mesh.positions.row(n) = mesh.positions.row(40);      // doubled
  mesh.positions.row(n + 1) = mesh.positions.row(40);  // three in one place
  mesh.positions.row(n + 2) << 2, 2, 2;                // loose
  mesh.triangles.conservativeResize(m + 4, 3);
  mesh.triangles.row(m) = mesh.triangles.row(17);  // doubled face
  mesh.triangles.row(m + 1) << 40, int(n), int(n + 1);
  mesh.triangles.row(m + 2) << 40, 41, int(n);
  mesh.triangles.row(m + 3) << mesh.triangles(20, 1), mesh.triangles(20, 0), mesh.triangles(20, 2);
  const IntrinsicTriangles intrinsic = intrinsic_delaunay(mesh.positions, mesh.triangles);
  CHECK(intrinsic.flips > 0);
  CHECK(intrinsic.flips < 20 * mesh.triangle_count());
  CHECK(intrinsic.lengths.allFinite());
  const auto made = surface_operators(mesh.positions, mesh.triangles, Triangulation::delaunay);
  CHECK(made.metric.cotangents.allFinite());
  CHECK(made.metric.areas.minCoeff() > 0);
  CHECK(made.masses.allFinite());
  // A vertex has triangles after the flips if it had some before.
  std::vector<int> before(static_cast<size_t>(n + 3), 0), after = before;
  for (Index k = 0; k < mesh.triangles.size(); ++k) {
    ++before[mesh.triangles.data()[k]];
    ++after[made.triangles.data()[k]];
  }
  for (size_t v = 0; v < before.size(); ++v) CHECK((before[v] > 0) == (after[v] > 0));
}

TEST_CASE("DELAUNAY: an edge of three triangles is never flipped") {
  // Three flat wings of obtuse triangles about one edge.
  Mesh mesh;
  mesh.positions.resize(5, 3);
  mesh.positions << 0, 0, 0, 1, 0, 0, 0.5, 0.05, 0, 0.5, -0.05, 0, 0.5, 0, 0.05;
  mesh.triangles.resize(3, 3);
  mesh.triangles << 0, 1, 2, 1, 0, 3, 0, 1, 4;
  CHECK(intrinsic_delaunay(mesh.positions, mesh.triangles).flips == 0);
  mesh.triangles.conservativeResize(2, 3);
  CHECK(intrinsic_delaunay(mesh.positions, mesh.triangles).flips == 1);
}

TEST_CASE("DELAUNAY: flips of a cone of thousands of needles come to an end") {
  const int sides = 4000;
  Mesh mesh;
  mesh.positions.resize(sides + 1, 3);
  mesh.positions.row(0) << 0, 0, 40;  // an apex so high that the triangles around it are needles
  for (int j = 0; j < sides; ++j) {
    const double v = 2 * std::acos(-1.0) * j / sides;
    mesh.positions.row(1 + j) << std::cos(v), std::sin(v), 0.02 * (j % 7);
  }
  mesh.triangles.resize(2 * sides - 2, 3);
  for (int j = 0; j < sides; ++j) mesh.triangles.row(j) << 0, 1 + j, 1 + (j + 1) % sides;
  for (int j = 2; j < sides; ++j) mesh.triangles.row(sides + j - 2) << 1, 1 + j, j;
  const auto made = surface_operators(mesh.positions, mesh.triangles, Triangulation::delaunay);
  CHECK(made.flipped);
  CHECK(made.metric.areas.allFinite());
  for (Index v = 0; v < made.laplacian.cols(); ++v)
    for (SparseMatrix::InnerIterator it(made.laplacian, v); it; ++it)
      if (it.row() != v) CHECK(it.value() < -0.5 * kObtuse + 1e-9);
}

TEST_CASE("DELAUNAY: around a leaning spike an edge runs from a vertex back to itself") {
  Mesh mesh;
  mesh.positions.resize(4, 3);
  mesh.positions << 0, 0, 40, 1, 0, 0, -0.5, 0.9, 5, -0.5, -0.9, 10;
  mesh.triangles.resize(4, 3);
  mesh.triangles << 0, 1, 2, 0, 2, 3, 0, 3, 1, 1, 3, 2;
  const auto given = surface_operators(mesh.positions, mesh.triangles);
  const auto made = surface_operators(mesh.positions, mesh.triangles, Triangulation::delaunay);
  int loops = 0;
  for (Index k = 0; k < made.triangles.size(); ++k)
    loops += made.triangles(k / 3, k % 3) == made.triangles(k / 3, (k + 1) % 3);
  CHECK(loops > 0);
  CHECK(loops % 2 == 0);  // a loop is counted from both of its sides
  CHECK(made.metric.areas.sum() == Approx(given.metric.areas.sum()).epsilon(1e-12));
  CHECK(made.masses.sum() == Approx(given.masses.sum()).epsilon(1e-12));
  const Eigen::MatrixXd L = made.laplacian;
  CHECK(largest_weight_against(mesh, given.laplacian) > 1);
  CHECK(largest_weight_against(mesh, L) < 1e-12);
  CHECK((L * Eigen::VectorXd::Ones(4)).cwiseAbs().maxCoeff() < 1e-12);
  // One part, so one zero among the eigenvalues.
  const Eigen::VectorXd values = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(L).eigenvalues();
  CHECK(std::abs(values[0]) < 1e-12);
  CHECK(values[1] > 1e-3);
}
