// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/geodesic_distances.h"

#include <cmath>
#include <limits>

#include "catch.h"
#include "meshes.h"

using namespace dd;

TEST_CASE("distances from a straight line on a plane are exact") {
  const int side = 31;
  const Mesh mesh = test::grid(side, side, [](double, double) { return 0.0; });
  std::vector<char> sources(static_cast<size_t>(mesh.vertex_count()), 0);
  const double left = mesh.positions.col(0).minCoeff();
  for (int v = 0; v < mesh.vertex_count(); ++v) sources[v] = mesh.positions(v, 0) == left;
  const std::vector<double> distance = geodesic_distances(mesh, sources);
  for (int v = 0; v < mesh.vertex_count(); ++v)
    CHECK(std::abs(distance[v] - (mesh.positions(v, 0) - left)) < 1e-12);
}

TEST_CASE(
    "distances from a vertex are those of the plane within a few percent and part of an edge") {
  const int side = 61;
  const Mesh mesh = test::grid(side, side, [](double, double) { return 0.0; });
  std::vector<char> sources(static_cast<size_t>(mesh.vertex_count()), 0);
  const int centre = side * (side / 2) + side / 2;
  sources[centre] = 1;
  const std::vector<double> distance = geodesic_distances(mesh, sources);
  for (int v = 0; v < mesh.vertex_count(); ++v) {
    const double expected = (mesh.positions.row(v) - mesh.positions.row(centre)).norm();
    CHECK(distance[v] > expected - 1e-12);
    CHECK(distance[v] <
          1.05 * expected + 0.4 / side);  // beside the source they err by a part of an edge
  }
}

TEST_CASE("distances on a cylinder go around it") {
  // The sheet is bent without stretching: distances are those of the plane.
  const int side = 81;
  const auto flat = test::grid(side, side, [](double, double) { return 0.0; });
  Mesh bent = flat;
  for (int v = 0; v < bent.vertex_count(); ++v) {
    const double angle = 2 * flat.positions(v, 0);
    bent.positions.row(v) << std::sin(angle) / 2, flat.positions(v, 1), std::cos(angle) / 2;
  }
  std::vector<char> sources(static_cast<size_t>(flat.vertex_count()), 0);
  sources[7] = sources[3 * side + 5] = 1;
  const auto on_flat = geodesic_distances(flat, sources),
             on_bent = geodesic_distances(bent, sources);
  for (int v = 0; v < flat.vertex_count(); ++v)
    CHECK(std::abs(on_bent[v] - on_flat[v]) < 2e-3 * on_flat[v] + 1e-12);
}

TEST_CASE("distances scale with the mesh and are infinite where no triangle leads") {
  Mesh mesh = test::grid(9, 9, [](double x, double y) { return 0.1 * std::sin(9 * x + y); });
  std::vector<char> sources(static_cast<size_t>(mesh.vertex_count()) + 1, 0);
  sources[4] = 1;
  mesh.positions.conservativeResize(mesh.positions.rows() + 1, 3);
  mesh.positions.bottomRows(1) << 0, 0, 1;  // a vertex without triangles
  const auto small = geodesic_distances(mesh, sources);
  mesh.positions *= 1000;
  const auto large = geodesic_distances(mesh, sources);
  CHECK(small.back() == std::numeric_limits<double>::infinity());
  for (size_t v = 0; v + 1 < small.size(); ++v)
    CHECK(std::abs(large[v] - 1000 * small[v]) < 1e-9 * (1 + large[v]));
}

TEST_CASE("distances on a plane are never too short, whatever the sources and the triangles") {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (int round = 0; round < 40; ++round) {
    // Regular, irregular, and sheared until most triangles are obtuse.
    const int side = 21;
    Mesh mesh = test::grid(side, side, [](double, double) { return 0.0; });
    const double jitter = 0.4 * (round % 3) / 2 / side, shear = round % 4;
    for (int i = 0; i < mesh.vertex_count(); ++i) {
      mesh.positions(i, 0) += jitter * uniform(random);
      mesh.positions(i, 1) += jitter * uniform(random);
      mesh.positions(i, 0) += shear * mesh.positions(i, 1);
    }
    std::vector<char> sources(static_cast<size_t>(mesh.vertex_count()), 0);
    std::vector<int> at;
    // In every second row and column, so that no two sources share an edge.
    for (int k = 0; k < 1 + round; ++k) {
      at.push_back(side * 2 * static_cast<int>(random() % 10) +
                   2 * static_cast<int>(random() % 10));
      sources[at.back()] = 1;
    }
    const std::vector<double> distance = geodesic_distances(mesh, sources);
    double shortest = 1;
    for (int v = 0; v < mesh.vertex_count(); ++v) {
      double exact = std::numeric_limits<double>::infinity();
      for (int s : at)
        exact = std::min(exact, (mesh.positions.row(v) - mesh.positions.row(s)).norm());
      if (exact > 0) shortest = std::min(shortest, distance[v] / exact);
    }
    CHECK(shortest > 1 - 1e-12);
  }
}
