// SPDX-License-Identifier: GPL-3.0-or-later
#include "match/registration.h"

#include <cmath>
#include <random>

#include "catch.h"
#include "match/triangle_match.h"
#include "mesh/aabb_tree.h"
#include "mesh/measures.h"
#include "mesh/triangles.h"
#include "mesh/unit_box.h"
#include "meshes.h"
#include "support/error.h"

using namespace dd;
using test::largest_difference;

namespace {

/// A smooth map far from a similarity: pulled long, bent, thicker at one end.
Eigen::RowVector3d shaped(const Eigen::RowVector3d& p) {
  const double x = 2.5 * p[0], y = p[1] * (1 + 0.3 * p[0]), z = p[2] * (1 + 0.3 * p[0]);
  return {x, y + 0.15 * x * x, z};
}

Mesh shaped_sphere(int levels, const Eigen::Matrix3d& turn) {
  Mesh mesh = test::sphere(levels);
  mesh.positions = mesh.positions * turn.transpose();
  for (Index v = 0; v < mesh.positions.rows(); ++v)
    mesh.positions.row(v) = shaped(mesh.positions.row(v));
  return mesh;
}

Mesh turned_sphere(int levels) {
  Mesh mesh = test::sphere(levels);
  mesh.positions *=
      Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix().transpose();
  return mesh;
}

int nearest_vertex(const Mesh& mesh, const Eigen::RowVector3d& point) {
  Index best = 0;
  (mesh.positions.rowwise() - point).rowwise().squaredNorm().minCoeff(&best);
  return static_cast<int>(best);
}

/// Markers at the ends of the axes.
Pairs markers(const Mesh& source, const Mesh& target) {
  Pairs pairs;
  for (const Eigen::RowVector3d& point :
       {Eigen::RowVector3d(1, 0, 0), Eigen::RowVector3d(-1, 0, 0), Eigen::RowVector3d(0, 1, 0),
        Eigen::RowVector3d(0, -1, 0), Eigen::RowVector3d(0, 0, 1), Eigen::RowVector3d(0, 0, -1)}) {
    const int from = nearest_vertex(source, point);
    pairs.push_back({from, nearest_vertex(target, shaped(source.positions.row(from)))});
  }
  return pairs;
}

double largest_distance(const Positions& points, const Mesh& mesh) {
  const AabbTree tree(mesh);
  double largest = 0;
  for (Index v = 0; v < points.rows(); ++v)
    largest = std::max(
        largest,
        tree.nearest(points.row(v).transpose(), 1e9, [](int) { return true; }).squared_distance);
  return std::sqrt(largest);
}

std::string refused_pairs(const Mesh& source, const Mesh& target, const Pairs& pairs) {
  try {
    register_onto(source, target, pairs, {});
  } catch (const Error& error) {
    return error.what();
  }
  return "accepted";
}

}  // namespace

TEST_CASE("the nearest point of a mesh is that of a search through all triangles") {
  const Mesh mesh = test::rough_sphere(3, 0.3);
  const AabbTree tree(mesh);
  std::mt19937 random(2);
  std::uniform_real_distribution<double> uniform(-1.5, 1.5);
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector3d point(uniform(random), uniform(random), uniform(random));
    const auto odd = [](int j) { return j % 2 == 1; };
    double least = 1e9;
    for (int j = 1; j < mesh.triangle_count(); j += 2) {
      // By descent in the barycentric weights: no formula shared with the core's.
      const Eigen::Vector3d a = mesh.positions.row(mesh.triangles(j, 0)),
                            b = mesh.positions.row(mesh.triangles(j, 1)),
                            c = mesh.positions.row(mesh.triangles(j, 2));
      double u = 1.0 / 3, v = 1.0 / 3, step = 1.0 / 3;
      const auto distance = [&](double at_u, double at_v) {
        return (a + at_u * (b - a) + at_v * (c - a) - point).norm();
      };
      double here = distance(u, v);
      while (step > 1e-7) {
        bool moved = false;
        const double moves[6][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}, {1, -1}, {-1, 1}};
        for (const auto& move : moves) {
          const double next_u = u + step * move[0], next_v = v + step * move[1];
          if (next_u < 0 || next_v < 0 || next_u + next_v > 1) continue;
          if (distance(next_u, next_v) < here - 1e-15) {
            u = next_u, v = next_v, here = distance(u, v), moved = true;
          }
        }
        if (!moved) step /= 2;
      }
      least = std::min(least, here);
    }
    const PointOnTriangle found = tree.nearest(point, 10, odd);
    CHECK(std::sqrt(found.squared_distance) == Approx(least).margin(1e-5));
    CHECK(odd(found.triangle));
    const auto corner = mesh.triangles.row(found.triangle);
    const Eigen::RowVector3d by_weights = found.barycentric[0] * mesh.positions.row(corner[0]) +
                                          found.barycentric[1] * mesh.positions.row(corner[1]) +
                                          found.barycentric[2] * mesh.positions.row(corner[2]);
    CHECK((by_weights - found.position.transpose()).norm() < 1e-12);
    CHECK(tree.nearest(point, 0.5 * least, odd).triangle < 0);
  }
}

TEST_CASE("the nearest point that faces is that of a search through all triangles") {
  const Mesh ball = test::rough_sphere(3, 0.3);
  const Mesh sheet =
      test::grid(30, 30, [](double x, double y) { return 0.05 * std::sin(9 * x * y); });
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-1.5, 1.5);
  for (const bool closed : {true, false}) {
    const Mesh& mesh = closed ? ball : sheet;
    const AabbTree tree(mesh);
    const Positions normals = triangle_normals(mesh.positions, mesh.triangles);
    int without = 0;
    for (int i = 0; i < 300; ++i) {
      const Eigen::Vector3d point(uniform(random), uniform(random), uniform(random));
      const Eigen::Vector3d normal(uniform(random), uniform(random), uniform(random));
      double least = 1e9;
      for (int j = 0; j < mesh.triangle_count(); ++j)
        if (normals.row(j).dot(normal) > 0)
          least = std::min(least, nearest_on_triangle(mesh, j, point).squared_distance);
      const PointOnTriangle found = tree.nearest_facing(point, normal, 100);
      CHECK((found.triangle >= 0) == (least < 1e9));
      without += found.triangle < 0;
      if (found.triangle < 0) continue;
      CHECK(found.squared_distance == least);
      CHECK(normals.row(found.triangle).dot(normal) > 0);
      CHECK(tree.nearest_facing(point, normal, 0.9 * std::sqrt(least)).triangle < 0);
    }
    CHECK((without > 50) == !closed);  // no triangle of a sheet faces about half of all directions
  }
}

TEST_CASE("registered by markers, a mesh lies on another of different topology") {
  const Mesh source = turned_sphere(4), target = shaped_sphere(5, Eigen::Matrix3d::Identity());
  const double box = bounding_box_diagonal(target.positions);
  const Pairs pairs = markers(source, target);
  const Positions fitted = register_onto(source, target, pairs, {});
  for (const auto& [from, to] : pairs)
    CHECK((fitted.row(from) - target.positions.row(to)).norm() < 1e-9 * box);
  CHECK(largest_distance(fitted, target) < 2e-3 * box);
  // The fit is near the map that made the target, and turns no triangle over.
  Positions mapped = source.positions;
  for (Index v = 0; v < mapped.rows(); ++v) mapped.row(v) = shaped(mapped.row(v));
  CHECK((fitted - mapped).rowwise().norm().mean() < 0.02 * box);
  CHECK(measure({mapped, source.triangles}, fitted,
                std::vector<char>(size_t(source.vertex_count()), 1))
            .new_intersecting_pairs == 0);

  const Match match = match_triangles({fitted, source.triangles}, target, 0.1);
  double worst = 1, mean = 0;
  for (float confidence : match.confidence) {
    worst = std::min(worst, double(confidence));
    mean += confidence / double(match.confidence.size());
  }
  CHECK(worst > 0.7);
  CHECK(mean > 0.97);
  std::vector<char> used(size_t(source.triangle_count()), 0);
  for (int j : match.correspondence.source) used[j] = 1;
  CHECK(std::find(used.begin(), used.end(), 0) == used.end());
  for (int j = 0; j < target.triangle_count(); ++j) CHECK(match.correspondence.has_source(j));
}

TEST_CASE("registration depends neither on units nor on where the source lies") {
  const Mesh source = turned_sphere(3), target = shaped_sphere(3, Eigen::Matrix3d::Identity());
  const Pairs pairs = markers(source, target);
  const Positions fitted = register_onto(source, target, pairs, {});
  const test::Affine motion = test::rotation_about(2, {1, 1, 3}, {0, 0, 0}, {50, 0, 3});
  const Mesh moved = {1e3 * test::transformed(motion, source.positions), source.triangles};
  const Mesh small = {1e-3 * target.positions, target.triangles};
  const double box = bounding_box_diagonal(target.positions);
  CHECK(largest_difference(1e3 * register_onto(moved, small, pairs, {}), fitted) < 1e-6 * box);
}

TEST_CASE("an open source is not pulled beyond an open target's border") {
  // A square onto half of itself: vertices without a counterpart must not gather at the border.
  const Mesh source = test::grid(21, 21, [](double, double) { return 0.0; });
  const Mesh target = test::grid(11, 21, [](double x, double y) { return 0.02 * x * y; });
  Mesh half = target;
  half.positions.col(0) *= 0.5;
  const Pairs pairs = {{0, 0}, {20, 20}, {10 * 21, 10 * 21}, {10 * 21 + 20, 10 * 21 + 20}};
  const Positions fitted = register_onto(source, half, pairs, {});
  CHECK(std::abs(fitted.row(20 * 21 + 10)[0] - 1) < 0.1);
  CHECK(largest_distance(fitted.topRows(10 * 21), half) < 0.01);
}

TEST_CASE(
    "markers that are contradictory or out of range are refused, and few or in a line are not") {
  const Mesh source = test::sphere(2), target = test::sphere(3);
  const Pairs good = {{0, 0}, {2, 2}, {4, 4}};
  CHECK(refused_pairs(source, target, good) == "accepted");
  CHECK(refused_pairs(source, target, {{0, 0}, {2, 2}, {4, 4}, {4, 4}}) == "accepted");
  CHECK(refused_pairs(source, target, {}) == "accepted");
  CHECK(refused_pairs(source, target, {{0, 0}, {2, 2}}) == "accepted");
  CHECK_THAT(refused_pairs(source, target, {{0, 0}, {2, 2}, {4, 4}, {4, 5}}),
             contains("is paired by markers with the vertices 4 and 5"));
  CHECK_THAT(refused_pairs(source, target, {{0, 0}, {2, 2}, {4, 9999}}),
             contains("vertex 9999 of the target"));
  CHECK_THAT(refused_pairs(source, target, {{5, 5}, {5, 5}, {3, 9999}}), contains("Pair 2 of"));
  Mesh flat = test::grid(5, 5, [](double, double) { return 0.0; });
  CHECK(refused_pairs(flat, target, {{0, 0}, {1, 2}, {2, 4}}) == "accepted");
  CHECK_THROWS_WITH(
      register_onto(source, target, good, {}, [](double done, Stage) { return done < 0.3; }),
      contains("cancelled"));
}

TEST_CASE("real meshes' faults are survived: loose, doubled, degenerate, in parts") {
  const Mesh ball = turned_sphere(3);
  Mesh source = test::appended(ball, {0.3 * ball.positions, ball.triangles});  // a part inside
  const Index n = source.positions.rows(), m = source.triangles.rows();
  source.positions.conservativeResize(n + 2, 3);
  source.positions.bottomRows(2) << 0.5, 0.5, 0.5, source.positions.row(7);  // loose; doubled
  source.triangles.conservativeResize(m + 3, 3);
  source.triangles.bottomRows(3) << source.triangles.row(5),  // twice the same face
      7, 8, static_cast<int>(n + 1),                          // no area
      source.triangles(9, 0), source.triangles(9, 1), 100;    // a third face at an edge
  Mesh target = shaped_sphere(4, Eigen::Matrix3d::Identity());
  target.triangles.conservativeResize(target.triangles.rows() + 1, 3);
  target.triangles.bottomRows(1) << 3, 4, 300;
  const Pairs pairs = markers(ball, target);
  const Positions fitted = register_onto(source, target, pairs, {});
  CHECK(fitted.allFinite());
  for (const auto& [from, to] : pairs)
    CHECK((fitted.row(from) - target.positions.row(to)).norm() < 1e-9);
  CHECK(largest_distance(fitted.topRows(ball.positions.rows()), target) < 0.1);
  const Match match = match_triangles({fitted, source.triangles}, target, 0.1);
  CHECK(match.confidence.size() == size_t(target.triangle_count()));
  CHECK(match.correspondence.target_count() == target.triangle_count());
}

TEST_CASE("markers tell a mirror image if they don't lie in a plane") {
  const Mesh source = turned_sphere(4), target = shaped_sphere(4, Eigen::Matrix3d::Identity());
  const Pairs pairs = markers(source, target);
  CHECK(!marked_as_mirror_image(source, target, pairs));
  CHECK(marked_as_mirror_image(mirror_image(source), target, pairs));
  const Pairs in_a_plane(pairs.begin(), pairs.begin() + 4);
  CHECK(!marked_as_mirror_image(mirror_image(source), target, in_a_plane));
  CHECK(!marked_as_mirror_image(source, target, {}));
  CHECK_THROWS_AS(marked_as_mirror_image(source, target, {{0, -1}}), Error);
  const Mesh twice = mirror_image(mirror_image(source));
  CHECK(twice.positions == source.positions);
  CHECK(twice.triangles == source.triangles);
}

TEST_CASE("specks beside a surface leave its registration solvable and in its place") {
  const Mesh target = test::rough_sphere(5, 0.02);
  const int count = target.vertex_count();
  Mesh source = target;
  for (const double side : {-1.0, 1.0}) {  // facing as the target does there
    Mesh speck = test::grid(2, 2, [](double, double) { return 0.0; });
    speck.positions *= 2e-6;
    speck.positions.col(2).array() += 1.28 * side;
    if (side < 0) speck.triangles.col(1).swap(speck.triangles.col(2));
    source = test::appended(source, speck);
  }
  Alignment lying;
  lying.lies_on = true;
  const Positions fitted = register_onto(source, target, {}, lying, {});
  CHECK(largest_difference(fitted.topRows(count), target.positions) < 1e-3);
  CHECK(fitted.allFinite());
}
