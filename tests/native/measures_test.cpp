// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/measures.h"

#include <Eigen/Dense>

#include "catch.h"
#include "dense_reference.h"
#include "mesh/intersections.h"
#include "meshes.h"

using namespace dd;

namespace {

std::vector<char> all_free(const Mesh& mesh) {
  return std::vector<char>(static_cast<size_t>(mesh.vertex_count()), 1);
}

/// Another formulation than the core's: solve for the point where the edge meets the plane.
bool edge_enters(const Mesh& mesh, int p, int q, int j) {
  const Eigen::Vector3d x = mesh.positions.row(p), y = mesh.positions.row(q);
  const Eigen::Vector3d a = mesh.positions.row(mesh.triangles(j, 0)),
                        b = mesh.positions.row(mesh.triangles(j, 1)),
                        c = mesh.positions.row(mesh.triangles(j, 2));
  Eigen::Matrix3d system;
  system << b - a, c - a, x - y;
  if (std::abs(system.determinant()) < 1e-300) return false;
  const Eigen::Vector3d s = system.inverse() * (x - a);  // two barycentric, one along the edge
  return s[0] > 0 && s[1] > 0 && s[0] + s[1] < 1 && s[2] > 0 && s[2] < 1;
}

std::vector<std::pair<int, int>> brute_force(const Mesh& mesh) {
  std::vector<std::pair<int, int>> pairs;
  for (int i = 0; i < mesh.triangle_count(); ++i)
    for (int j = i + 1; j < mesh.triangle_count(); ++j) {
      std::vector<int> shared;
      for (int k = 0; k < 3; ++k)
        if ((mesh.triangles.row(j).array() == mesh.triangles(i, k)).any())
          shared.push_back(mesh.triangles(i, k));
      if (shared.size() > 1) continue;
      bool hit = false;
      for (const auto& [edges_of, other] : {std::pair(i, j), std::pair(j, i)})
        for (int k = 0; k < 3; ++k) {
          const int p = mesh.triangles(edges_of, k), q = mesh.triangles(edges_of, (k + 1) % 3);
          if (!shared.empty() && (p == shared[0] || q == shared[0])) continue;
          hit |= edge_enters(mesh, p, q, other);
        }
      if (hit) pairs.emplace_back(i, j);
    }
  return pairs;
}

}  // namespace

TEST_CASE("intersecting pairs are those of brute force") {
  std::srand(4);
  SECTION("two spheres through each other") {
    Mesh a = test::sphere(3), b = test::sphere(3);
    b.positions.rowwise() += Eigen::RowVector3d(0.61, 0.37, 0.23);
    const Mesh both = test::appended(a, b);
    const auto pairs = intersecting_pairs(both);
    CHECK(pairs.size() > 50);
    CHECK(pairs == brute_force(both));
  }
  SECTION("a crumpled sphere, whose neighbours at a vertex intersect too") {
    Mesh mesh = test::sphere(2);
    mesh.positions += 0.4 * Positions::Random(mesh.vertex_count(), 3);
    const auto pairs = intersecting_pairs(mesh);
    CHECK(pairs.size() > 10);
    CHECK(pairs == brute_force(mesh));
  }
  SECTION("none") {
    CHECK(intersecting_pairs(test::rough_sphere(3, 0.05)).empty());
    CHECK(intersecting_pairs(test::bumpy_plane(41, 4)).empty());
  }
}

TEST_CASE("a rigid motion stretches nothing, a scaling by s stretches by √2 |s − 1|") {
  const Mesh mesh = test::rough_sphere(3, 0.1);
  const auto motion = test::rotation_about(1.2, {1, 2, 3}, {0, 0, 0}, {5, 6, 7});
  const Measures rigid = measure(mesh, test::transformed(motion, mesh.positions), all_free(mesh));
  CHECK(rigid.stretch < 1e-12);
  CHECK(rigid.area_ratio == Approx(1));
  CHECK(rigid.volume_ratio == Approx(1));
  const Measures scaled = measure(mesh, 1.5 * mesh.positions, all_free(mesh));
  CHECK(scaled.stretch == Approx(std::sqrt(2.0) * 0.5));
  CHECK(scaled.area_ratio == Approx(2.25));
  CHECK(scaled.volume_ratio == Approx(3.375));
}

TEST_CASE("a needle at rest is not stretched, however thin, and scaled as any triangle is") {
  for (double height : {1e-6, 1e-9, 1e-12}) {
    INFO("height " << height);
    const Eigen::RowVector3d along(1.1, 0.7, 0.3), across(0.3, -0.6, 0.3);
    Mesh needle;
    needle.positions.resize(3, 3);
    needle.positions << 0, 0, 0, along, 0.61 * along + height * across;
    needle.triangles.resize(1, 3);
    needle.triangles << 0, 1, 2;
    const auto free = all_free(needle);
    CHECK(measure(needle, needle.positions, free, {}, {}).stretch == 0);
    CHECK(measure(needle, 2 * needle.positions, free, {}, {}).stretch ==
          Approx(std::sqrt(2.0)).epsilon(1e-14 / height));
  }
}

TEST_CASE("stretch is ‖S − R‖ of (15) and its polar rotation, normal error an angle to them") {
  const Mesh mesh = test::rough_sphere(2, 0.2);
  Positions deformed = mesh.positions, base = mesh.positions.rowwise().normalized();
  for (Index v = 0; v < deformed.rows(); ++v)
    deformed.row(v) << deformed(v, 0) + 0.4 * deformed(v, 1), 1.3 * deformed(v, 1),
        deformed(v, 2) * (1 + 0.3 * deformed(v, 0));
  const auto turn = test::rotation_about(0.5, {0, 0, 1}, {0, 0, 0}, {0, 0, 0});
  const Positions turned_base = test::transformed(turn, base);
  double stretch = 0, area = 0, angle = 0;
  for (Index j = 0; j < mesh.triangles.rows(); ++j) {
    const Eigen::Matrix3d S =
        test::deformation_gradient(mesh.positions, deformed, mesh.triangles, j);
    const Eigen::Vector3d e1 =
        mesh.positions.row(mesh.triangles(j, 1)) - mesh.positions.row(mesh.triangles(j, 0));
    const Eigen::Vector3d e2 =
        mesh.positions.row(mesh.triangles(j, 2)) - mesh.positions.row(mesh.triangles(j, 0));
    const double weight = e1.cross(e2).norm();
    stretch += weight * (S - test::polar_rotation(S)).norm();
    area += weight;
    angle += std::acos(
        test::triangle_normal(deformed, mesh.triangles, j)
            .dot(turn.leftCols<3>() * test::triangle_normal(mesh.positions, mesh.triangles, j)));
  }
  const Measures m = measure(mesh, deformed, all_free(mesh), base, turned_base);
  CHECK(m.stretch == Approx(stretch / area).epsilon(1e-9));
  CHECK(m.normal_error ==
        Approx(angle / double(mesh.triangle_count()) * 180 / std::acos(-1.0)).epsilon(1e-9));
}

TEST_CASE("only triangles with a free corner count, and pairs that intersect at rest aren't new") {
  Mesh a = test::sphere(2), b = test::sphere(2);
  b.positions.rowwise() += Eigen::RowVector3d(0.5, 0.1, 0.2);
  const Mesh both = test::appended(a, b);
  const Measures still = measure(both, both.positions, all_free(both));
  CHECK(still.intersecting_pairs > 0);
  CHECK(still.new_intersecting_pairs == 0);
  const std::vector<char> none(static_cast<size_t>(both.vertex_count()), 0);
  CHECK(measure(both, both.positions, none).intersecting_pairs == 0);
  Positions apart = both.positions;
  apart.topRows(a.vertex_count()).col(0).array() -= 5;
  Mesh rest = both;
  rest.positions = apart;
  const Measures pushed = measure(rest, both.positions, all_free(both));
  CHECK(pushed.new_intersecting_pairs == still.intersecting_pairs);
}
