// SPDX-License-Identifier: GPL-3.0-or-later
#include "match/limb_tips.h"

#include <algorithm>

#include "catch.h"
#include "creatures.h"
#include "match/alignment.h"
#include "match/registration.h"

using namespace dd;

TEST_CASE("three markers lose nothing of a match that the shapes alone would give", "[large]") {
  const auto farthest = [](const Mesh& mesh, const Eigen::RowVector3d& way) {
    Index v = 0;
    (mesh.positions * way.transpose()).maxCoeff(&v);
    return static_cast<int>(v);
  };
  const auto marked = [&](const Mesh& mesh, const std::vector<Eigen::RowVector3d>& ways) {
    Pairs markers;  // finer spheres have the same vertices and more
    for (const auto& way : ways) markers.push_back({farthest(mesh, way), farthest(mesh, way)});
    return markers;
  };
  // Markers on feet that a stride has swung by 57°: no similarity fits them.
  const Mesh rest = test::quadruped(4);
  const Mesh source = {test::striding(test::quadruped(5).positions, 1),
                       test::quadruped(5).triangles};
  for (const Eigen::RowVector3d& third :
       {Eigen::RowVector3d(0.7, -0.35, -1), Eigen::RowVector3d(1, 0, 0.7)}) {
    const Pairs markers = marked(rest, {{0.7, 0.35, -1}, {-0.7, -0.35, -1}, third});
    CHECK(test::mean_error(register_onto(source, rest, markers, {}), test::quadruped(5).positions) <
          0.02);
  }
  // Markers on limbs, one of which is bent, without a functional map: a fit of the markers alone
  // would shear the body.
  const Mesh straight = test::beast(5);
  const Mesh bent = {test::raised(test::beast(4).positions, 0.35), test::beast(4).triangles};
  const Pairs markers = marked(test::beast(4), {{1, 0.1, 0.3}, {-0.8, 0.5, -0.2}, {0.1, -1, 0.4}});
  Alignment placed = align(straight, bent, markers);
  placed.map_target.clear();
  placed.lies_on = false;
  CHECK(test::mean_error(register_onto(straight, bent, markers, placed, {}),
                         test::raised(straight.positions, 0.35)) < 0.01);
}

TEST_CASE("limbs have tips at their ends, which are paired with those of the same limb") {
  const int levels[2] = {5, 4};
  const Mesh shapes[2] = {test::quadruped(5), test::quadruped(4, 3.5, 2.5)};
  const CoarseShape coarse[2] = {CoarseShape(shapes[0]), CoarseShape(shapes[1])};
  // The vertex at the end of each limb.
  int ends[2][6];
  for (int side = 0; side < 2; ++side) {
    const Positions ways = test::sphere(levels[side]).positions;
    for (int k = 0; k < 6; ++k) {
      Index v = 0;
      (ways * Eigen::Vector3d(test::kLimbs[k][0], test::kLimbs[k][1], test::kLimbs[k][2]))
          .maxCoeff(&v);
      ends[side][k] = static_cast<int>(v);
    }
    CHECK(limb_tips(coarse[side].mesh, coarse[side].samples).size() >= 6);
  }
  const auto limb_of = [&](int side, int tip) {
    const Positions& p = shapes[side].positions;
    const auto way = [&](int end) {
      return (p.row(coarse[side].vertices[size_t(tip)]) - p.row(end)).norm();
    };
    const int* nearest =
        std::min_element(ends[side], ends[side] + 6, [&](int a, int b) { return way(a) < way(b); });
    CHECK(way(*nearest) < 0.6);  // a tenth of the body's length
    return nearest - ends[side];
  };
  const Pairs pairs = paired_tips(coarse[0], coarse[1], {}, {});
  CHECK(pairs.size() == 6);
  for (const auto& [one, other] : pairs) CHECK(limb_of(0, one) == limb_of(1, other));
  // A marked tip is left out, which leaves the other pairs as they are.
  const Pairs others = paired_tips(coarse[0], coarse[1], {}, {pairs[0]});
  CHECK(others.size() == 5);
  for (const std::array<int, 2>& pair : others)
    CHECK(std::count(pairs.begin(), pairs.end(), pair) == 1);
  const CoarseShape ball(test::sphere(4));
  CHECK(limb_tips(ball.mesh, ball.samples).empty());
  CHECK(paired_tips(ball, coarse[1], {}, {}).empty());
}

TEST_CASE("limbs of other lengths are found without markers", "[large]") {
  const Mesh low = test::quadruped(5), tall = test::quadruped(4, 3.5, 2.5);
  const Positions truth = test::quadruped(5, 3.5, 2.5).positions;
  Alignment found = align(low, tall, {});
  CHECK(found.tips.size() == 6);
  const double by_tips = test::mean_error(register_onto(low, tall, {}, found, {}), truth);
  CHECK(by_tips < 0.04);
  // Wrong pairs cost nothing: the alignment that they lead to isn't trusted.
  std::swap(found.tips[0][1], found.tips[1][1]);
  const double astray = test::mean_error(register_onto(low, tall, {}, found, {}), truth);
  found.tips.clear();
  const double without = test::mean_error(register_onto(low, tall, {}, found, {}), truth);
  CHECK(by_tips < 0.85 * without);
  CHECK(astray <= without);
}
