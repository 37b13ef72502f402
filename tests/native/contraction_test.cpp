// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/contraction.h"

#include <set>

#include "cases.h"
#include "catch.h"

using namespace dd;

namespace {

/// Vertices less edges plus triangles: 2 for a closed surface without a hole through it.
int euler_characteristic(const Triangles& triangles) {
  std::set<int> vertices;
  std::set<std::pair<int, int>> edges;
  for (Index j = 0; j < triangles.rows(); ++j)
    for (int k = 0; k < 3; ++k) {
      vertices.insert(triangles(j, k));
      edges.insert(std::minmax(int(triangles(j, k)), int(triangles(j, (k + 1) % 3))));
    }
  return static_cast<int>(vertices.size()) - static_cast<int>(edges.size()) +
         static_cast<int>(triangles.rows());
}

double area(const Mesh& mesh, const Contraction& made) {
  double sum = 0;
  for (Index j = 0; j < made.triangles.rows(); ++j) {
    const auto place = [&](int k) -> Eigen::RowVector3d {
      return mesh.positions.row(made.vertices[made.triangles(j, k)]);
    };
    sum += 0.5 * (place(1) - place(0)).cross(place(2) - place(0)).norm();
  }
  return sum;
}

std::vector<double> everywhere(const Mesh& mesh, double radius) {
  return std::vector<double>(static_cast<size_t>(mesh.vertex_count()), radius);
}

Mesh torus(int rings, int sides, double thickness) {
  Mesh mesh;
  mesh.positions.resize(rings * sides, 3);
  mesh.triangles.resize(2 * rings * sides, 3);
  const double turn = 2 * std::acos(-1.0);
  int t = 0;
  for (int i = 0; i < rings; ++i)
    for (int j = 0; j < sides; ++j) {
      const double u = turn * i / rings, v = turn * j / sides, r = 1 + thickness * std::cos(v);
      mesh.positions.row(i * sides + j) << r * std::cos(u), r * std::sin(u),
          thickness * std::sin(v);
      const int a = i * sides + j, b = (i + 1) % rings * sides + j,
                right = (j + 1) % sides - j;  // to the next vertex of the ring
      mesh.triangles.row(t++) << a, b, b + right;
      mesh.triangles.row(t++) << a, b + right, a + right;
    }
  return mesh;
}

}  // namespace

TEST_CASE("contraction: no vertex goes farther than its radius, the topology stays") {
  struct {
    const char* name;
    Mesh mesh;
    double radius, area;
    int characteristic;
  } const cases[] = {
      {"sheet", test::grid(61, 61, [](double, double) { return 0.0; }), 0.06, 1, 1},
      {"sphere", test::sphere(5), 0.15, 4 * std::acos(-1.0), 2},
      {"torus", torus(160, 60, 0.4), 0.12, 0.4 * std::pow(2 * std::acos(-1.0), 2), 0},
      {"tube", test::bent_cylinder().mesh, 0.04, 0, 2},
  };
  for (const auto& one : cases) {
    INFO(one.name);
    const Contraction made = contract(one.mesh, everywhere(one.mesh, one.radius));
    CHECK(4 * made.vertices.size() < size_t(one.mesh.vertex_count()));
    CHECK(made.vertices.size() > 100);
    CHECK(euler_characteristic(made.triangles) == one.characteristic);
    CHECK(std::is_sorted(made.vertices.begin(), made.vertices.end()));
    double farthest = 0, nearest = 1e9;
    for (int v = 0; v < one.mesh.vertex_count(); ++v) {
      const int center = made.vertices[made.of_vertex[v]];
      farthest =
          std::max(farthest, (one.mesh.positions.row(v) - one.mesh.positions.row(center)).norm());
    }
    for (Index j = 0; j < made.triangles.rows(); ++j)
      for (int k = 0; k < 3; ++k)
        nearest = std::min(nearest,
                           (one.mesh.positions.row(made.vertices[made.triangles(j, k)]) -
                            one.mesh.positions.row(made.vertices[made.triangles(j, (k + 1) % 3)]))
                               .norm());
    CHECK(farthest <= one.radius * (1 + 1e-12));
    CHECK(nearest > 0.5 * one.radius);  // kept vertices are a radius apart along edges
    if (one.area > 0) CHECK(area(one.mesh, made) == Approx(one.area).epsilon(0.05));
  }
}

TEST_CASE("contraction: without radii nothing changes, and a vertex without one stays alone") {
  const Mesh mesh = test::grid(31, 31, [](double x, double y) { return 0.1 * x * y; });
  const Contraction same = contract(mesh, everywhere(mesh, 0));
  CHECK(same.triangles == mesh.triangles);
  CHECK(same.vertices.size() == size_t(mesh.vertex_count()));

  std::vector<double> radii = everywhere(mesh, 0.1);
  for (int v = 0; v < 31; ++v) radii[v] = 0;
  const Contraction made = contract(mesh, radii);
  for (int v = 0; v < 31; ++v) CHECK(made.vertices[made.of_vertex[v]] == v);
  std::vector<int> gone(made.vertices.size(), 0);
  for (int number : made.of_vertex) ++gone[number];
  for (int v = 0; v < 31; ++v) CHECK(gone[made.of_vertex[v]] == 1);
}

TEST_CASE("contraction: a part too narrow for its radii stays as it is") {
  // A ball on a wire: a tube of 12 sides whose upper half is thin.
  const Mesh mesh = test::tube(161, 12, [](double u, double v) {
    const double radius = u < 0.5 ? 0.2 * std::sin(std::acos(-1.0) * std::min(2 * u, 0.98)) + 0.005
                                  : 0.005 + 0.007 * (u < 0.51);
    return Eigen::RowVector3d(radius * std::cos(v), radius * std::sin(v), u);
  });
  const Contraction made = contract(mesh, everywhere(mesh, 0.04));
  CHECK(euler_characteristic(made.triangles) == 2);
  CHECK(5 * made.vertices.size() < 4 * size_t(mesh.vertex_count()));
  int alone = 0, on_wire = 0;
  for (int v = 0; v < mesh.vertex_count(); ++v)
    if (mesh.positions(v, 2) > 0.6 && mesh.positions(v, 2) < 0.99) {
      ++on_wire;
      alone += made.vertices[made.of_vertex[v]] == v;
    }
  CHECK(alone > 0.9 * on_wire);
  CHECK(on_wire > 500);
}

TEST_CASE("contraction: fins, holes and loose vertices are allowed, numbering doesn't matter") {
  Mesh mesh = test::grid(41, 41, [](double x, double y) { return 0.1 * std::sin(9 * x) * y; });
  std::mt19937 random(5);
  for (Index v = 0; v < mesh.positions.rows(); ++v)
    for (int c = 0; c < 3; ++c)
      mesh.positions(v, c) += 0.004 * std::uniform_real_distribution<double>(-0.5, 0.5)(random);
  const Index m = mesh.triangles.rows(), n = mesh.positions.rows();
  mesh.positions.conservativeResize(n + 2, 3);
  mesh.positions.row(n) << 0.5, 0.5, 0.4;
  mesh.positions.row(n + 1) << 3, 3, 3;  // loose
  mesh.triangles.conservativeResize(m + 2, 3);
  mesh.triangles.row(m) << 20 * 41 + 20, 20 * 41 + 21, int(n);  // a third triangle at an edge
  mesh.triangles.row(m + 1) = mesh.triangles.row(7);
  mesh.triangles.row(100) << 0, 1, 42;  // leaves a hole
  const Contraction made = contract(mesh, everywhere(mesh, 0.08));
  CHECK(made.of_vertex[n + 1] == -1);
  CHECK(made.of_vertex[n] >= 0);
  CHECK(5 * made.vertices.size() < 3 * size_t(n));
  for (Index j = 0; j < made.triangles.rows(); ++j) {
    const auto t = made.triangles.row(j);
    CHECK((t[0] != t[1] && t[1] != t[2] && t[2] != t[0]));
  }

  const auto other = test::renumbered(mesh, std::vector<int>(size_t(n + 2), kFree));
  const Contraction same = contract(other.mesh, everywhere(mesh, 0.08));
  std::set<int> expected, found(same.vertices.begin(), same.vertices.end());
  for (int v : made.vertices) expected.insert(other.new_of_old[v]);
  CHECK(found == expected);
}
