// SPDX-License-Identifier: GPL-3.0-or-later
#include "systems/operators.h"

#include <Eigen/Dense>

#include "base/base_surface.h"
#include "catch.h"
#include "dense_reference.h"
#include "meshes.h"

using namespace dd;

namespace {

Eigen::VectorXd random_vector(Index n, unsigned seed) {
  std::srand(seed);
  return Eigen::VectorXd::Random(n);
}

}  // namespace

TEST_CASE("Laplacian, masses and gradient equal the dense ones, which are made from angles") {
  for (const Mesh& mesh : {test::rough_sphere(2, 0.2), test::bumpy_plane(9, 3)}) {
    const auto metric = triangle_metric(mesh.positions, mesh.triangles);
    const int n = mesh.vertex_count();
    const auto dense = test::dense_operators(mesh.positions, mesh.triangles);
    const Eigen::MatrixXd L = cotangent_laplacian(metric, mesh.triangles, n);
    const Eigen::MatrixXd G = gradient(mesh.positions, mesh.triangles);
    CHECK(metric.degenerate.empty());
    CHECK((L - dense.L).norm() < 1e-11 * dense.L.norm());
    CHECK((G - dense.G).norm() < 1e-11 * dense.G.norm());
    CHECK((mixed_voronoi_masses(metric, mesh.triangles, n) - dense.M.diagonal()).norm() <
          1e-11 * dense.M.norm());
  }
}

TEST_CASE("L = GᵀDG, L 1 = 0, zᵀLz is the Dirichlet energy, masses sum to the area") {
  const Mesh mesh = test::rough_sphere(3, 0.1);
  const int n = mesh.vertex_count();
  const auto metric = triangle_metric(mesh.positions, mesh.triangles);
  const SparseMatrix L = cotangent_laplacian(metric, mesh.triangles, n);
  const SparseMatrix G = gradient(mesh.positions, mesh.triangles);
  const SparseMatrix div = divergence(G, metric);
  CHECK(SparseMatrix(div * G - L).norm() < 1e-12 * L.norm());
  CHECK((L * Eigen::VectorXd::Ones(n)).cwiseAbs().maxCoeff() < 1e-12);

  const Eigen::VectorXd z = random_vector(n, 3);
  double energy = 0;
  const Eigen::VectorXd slopes = G * z;
  for (Index j = 0; j < metric.areas.size(); ++j)
    energy += metric.areas[j] * slopes.segment<3>(3 * j).squaredNorm();
  CHECK(z.dot(L * z) == Approx(energy).epsilon(1e-12));

  const Eigen::VectorXd masses = mixed_voronoi_masses(metric, mesh.triangles, n);
  CHECK(masses.sum() == Approx(metric.areas.sum()).epsilon(1e-13));
  CHECK(masses.minCoeff() > 0);
}

TEST_CASE("L is symmetric to the bit, with triangles that have a vertex twice or thrice, too") {
  // Triangles that intrinsic flips may make, and three around one edge.
  Triangles t(7, 3);
  t << 0, 1, 2, 0, 1, 0, 2, 2, 2, 1, 0, 3, 1, 3, 1, 0, 1, 4, 3, 0, 0;
  TriangleMetric metric;
  metric.areas = Eigen::VectorXd::Ones(7);
  metric.cotangents.resize(7, 3);
  for (Index i = 0; i < metric.cotangents.size(); ++i)
    metric.cotangents.data()[i] = 0.1 + std::sin(double(i)) / 3;
  const Eigen::MatrixXd L = cotangent_laplacian(metric, t, 6);
  CHECK((L - L.transpose()).cwiseAbs().maxCoeff() == 0);
  CHECK(L.rowwise().sum().cwiseAbs().maxCoeff() < 1e-15);
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(6, 6);
  for (Index j = 0; j < 7; ++j)
    for (int k = 0; k < 3; ++k) {
      const Eigen::VectorXd edge =
          Eigen::VectorXd::Unit(6, t(j, (k + 1) % 3)) - Eigen::VectorXd::Unit(6, t(j, (k + 2) % 3));
      dense += 0.5 * metric.cotangents(j, k) * edge * edge.transpose();
    }
  CHECK((L - dense).cwiseAbs().maxCoeff() < 1e-15);
}

TEST_CASE("L is positive semi-definite with one zero eigenvalue a part") {
  const Mesh mesh = test::appended(test::rough_sphere(1, 0.2), test::sphere(1));
  const Eigen::MatrixXd L = cotangent_laplacian(triangle_metric(mesh.positions, mesh.triangles),
                                                mesh.triangles, mesh.vertex_count());
  const Eigen::VectorXd values = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(L).eigenvalues();
  CHECK(std::abs(values[0]) < 1e-12);
  CHECK(std::abs(values[1]) < 1e-12);
  CHECK(values[2] > 1e-3);
}

TEST_CASE("linear precision: L of a linear function vanishes inside a plane") {
  Mesh mesh = test::grid(12, 9, [](double, double) { return 0.0; });
  std::mt19937 random(4);
  std::uniform_real_distribution<double> jitter(-0.02, 0.02);
  for (Index v = 0; v < mesh.positions.rows(); ++v)
    mesh.positions.row(v).head<2>() += Eigen::RowVector2d(jitter(random), jitter(random));
  const SparseMatrix L = cotangent_laplacian(triangle_metric(mesh.positions, mesh.triangles),
                                             mesh.triangles, mesh.vertex_count());
  const Eigen::VectorXd linear = mesh.positions * Eigen::Vector3d(2, -3, 0);
  const Eigen::VectorXd residual = L * linear;
  for (int i = 1; i < 11; ++i)
    for (int j = 1; j < 8; ++j) CHECK(std::abs(residual[i * 9 + j]) < 1e-12);
}

TEST_CASE("the gradient of the position is the projection I - n nᵀ (§5)") {
  const Mesh mesh = test::rough_sphere(2, 0.2);
  const Eigen::MatrixXd gradients = gradient(mesh.positions, mesh.triangles) * mesh.positions;
  for (Index j = 0; j < mesh.triangles.rows(); ++j) {
    const Eigen::Vector3d n = test::triangle_normal(mesh.positions, mesh.triangles, j);
    const Eigen::Matrix3d projection = Eigen::Matrix3d::Identity() - n * n.transpose();
    CHECK((gradients.middleRows<3>(3 * j) - projection).cwiseAbs().maxCoeff() < 1e-12);
  }
}

TEST_CASE("div(Sᵀ) and div(G Sᵀ) give one answer, and so does the corner form") {
  const Mesh mesh = test::rough_sphere(2, 0.2);
  const int n = mesh.vertex_count();
  const auto metric = triangle_metric(mesh.positions, mesh.triangles);
  const SparseMatrix G = gradient(mesh.positions, mesh.triangles);
  const SparseMatrix div = divergence(G, metric);
  const Eigen::MatrixXd position_gradients = G * mesh.positions;
  const Positions flux = corner_divergence(metric, mesh.positions, mesh.triangles);

  Eigen::MatrixXd transposed(G.rows(), 3), projected(G.rows(), 3);
  Eigen::MatrixXd by_corner = Eigen::MatrixXd::Zero(n, 3);
  std::srand(5);
  for (Index j = 0; j < mesh.triangles.rows(); ++j) {
    const Eigen::Matrix3d S = Eigen::Matrix3d::Random();
    transposed.middleRows<3>(3 * j) = S.transpose();
    projected.middleRows<3>(3 * j) = position_gradients.middleRows<3>(3 * j) * S.transpose();
    for (int k = 0; k < 3; ++k)
      by_corner.row(mesh.triangles(j, k)) += flux.row(3 * j + k) * S.transpose();
  }
  const Eigen::MatrixXd expected = div * transposed;
  CHECK((div * projected - expected).norm() < 1e-12 * expected.norm());
  CHECK((by_corner - expected).norm() < 1e-12 * expected.norm());
}

TEST_CASE("L is scale-free, masses grow with the square") {
  const Mesh mesh = test::rough_sphere(2, 0.2);
  const int n = mesh.vertex_count();
  const auto metric = triangle_metric(mesh.positions, mesh.triangles);
  for (double scale : {1e-4, 1e4}) {
    const auto scaled = triangle_metric(scale * mesh.positions, mesh.triangles);
    CHECK((scaled.cotangents - metric.cotangents).norm() < 1e-12 * metric.cotangents.norm());
    CHECK((mixed_voronoi_masses(scaled, mesh.triangles, n) / (scale * scale) -
           mixed_voronoi_masses(metric, mesh.triangles, n))
              .norm() < 1e-12);
  }
}

TEST_CASE("triangles without area are counted, finite, and change no other triangle") {
  Mesh mesh = test::rough_sphere(1, 0.1);
  const auto before = triangle_metric(mesh.positions, mesh.triangles);
  const Index m = mesh.triangles.rows();
  mesh.positions.conservativeResize(mesh.positions.rows() + 3, 3);
  const Index n = mesh.positions.rows();
  mesh.positions.bottomRows(3) << 5, 0, 0, 6, 0, 0, 8, 0, 0;  // on one line
  mesh.triangles.conservativeResize(m + 3, 3);
  mesh.triangles.row(m) << int(n - 3), int(n - 2), int(n - 1);
  mesh.triangles.row(m + 1) << 0, 5, int(n - 1);
  mesh.triangles.row(m + 2) << 2, 3, 4;
  mesh.positions.row(3) = mesh.positions.row(2);  // two corners in one place, as in others
  mesh.positions.row(4) = mesh.positions.row(2);  // three
  const auto metric = triangle_metric(mesh.positions, mesh.triangles);

  CHECK(metric.cotangents.allFinite());
  CHECK(metric.areas.minCoeff() > 0);
  for (int j : {int(m), int(m + 2)})
    CHECK(std::count(metric.degenerate.begin(), metric.degenerate.end(), j) == 1);
  CHECK(std::count(metric.degenerate.begin(), metric.degenerate.end(), int(m + 1)) == 0);
  for (Index j = 0; j < m; ++j) {
    const auto t = mesh.triangles.row(j);
    const bool moved = (t.array() == 3 || t.array() == 4).any();
    if (!moved) CHECK(metric.cotangents.row(j) == before.cotangents.row(j));
  }
  const SparseMatrix G = gradient(mesh.positions, mesh.triangles);
  const SparseMatrix L = cotangent_laplacian(metric, mesh.triangles, int(n));
  CHECK(Eigen::MatrixXd(G).allFinite());
  CHECK((L * Eigen::VectorXd::Ones(n)).cwiseAbs().maxCoeff() < 1e-6);
  CHECK(corner_divergence(metric, mesh.positions, mesh.triangles).allFinite());
}

TEST_CASE("fairing flattens relief and leaves a plane alone") {
  const Mesh flat = test::grid(15, 15, [](double, double) { return 0.0; });
  const Mesh bumpy = test::bumpy_plane(31, 5);
  const auto operators = surface_operators(bumpy.positions, bumpy.triangles);
  const Positions faired = faired_surface(bumpy, operators, 2);
  CHECK(faired.col(2).maxCoeff() < 0.7 * bumpy.positions.col(2).maxCoeff());
  CHECK(faired.col(2).minCoeff() > 0);  // the maximum principle
  const auto of_flat = surface_operators(flat.positions, flat.triangles);
  CHECK(faired_surface(flat, of_flat, 2).col(2).cwiseAbs().maxCoeff() == 0);
}
