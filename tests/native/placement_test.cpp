// SPDX-License-Identifier: GPL-3.0-or-later
#include "match/placement.h"

#include <Eigen/Geometry>
#include <cmath>

#include "catch.h"
#include "creatures.h"
#include "match/alignment.h"
#include "match/registration.h"
#include "mesh/aabb_tree.h"
#include "mesh/triangles.h"
#include "random_meshes.h"

using namespace dd;

TEST_CASE("what a remesh lacks, as the inside of a mouth, doesn't move the rest", "[large]") {
  const Mesh source = test::hollow(5), closed = test::beast(4);
  const Mesh target = {3 * test::turned(closed.positions, 2), closed.triangles};
  const Positions truth = 3 * test::turned(source.positions, 2);
  const Alignment lying = align(source, target, {});
  REQUIRE(lying.lies_on);
  CHECK_FALSE(lying.ambiguous);
  CHECK(test::mean_error(lying.placement.all(source.positions), truth) < 2e-3);
  const auto fitted = [&](const Alignment& alignment) {
    return register_onto(source, target, {}, alignment, {});
  };
  const auto error_outside = [&](const Positions& p) {
    const auto is_outside = [&](Index v) {
      return source.positions.row(v).norm() > 1.1 * test::kCavity;
    };
    return test::mean_error(p, truth, is_outside);
  };
  const Positions found = fitted(lying);
  CHECK(error_outside(found) < 5e-3);
  // Without lies_on, parts without a counterpart drag the rest along.
  Alignment by_all = lying;
  by_all.lies_on = false;
  CHECK(error_outside(fitted(by_all)) > 2.5 * error_outside(found));
}

TEST_CASE(
    "of placements that fit about as well the one that stands as it was is taken, or a marker's") {
  const auto ball = [](double x, double y, double radius) {
    Mesh mesh = test::sphere(2);
    mesh.positions *= radius;
    mesh.positions.col(2) *= 3;
    mesh.positions.rowwise() += Eigen::RowVector3d(x, y, 0);
    return mesh;
  };
  Mesh legs = ball(1, 1, 0.2);
  for (const auto& [x, y] : {std::pair{1, -1}, {-1, 1}, {-1, -1}})
    legs = test::appended(legs, ball(x, y, 0.2));
  const auto shaken = [](Mesh mesh) {
    for (Index i = 0; i < mesh.positions.size(); ++i)
      mesh.positions.data()[i] += 1e-4 * std::sin(7.0 * static_cast<double>(i));
    return mesh;
  };
  const Alignment alike = align(legs, shaken(legs), {});
  CHECK(alike.lies_on);
  CHECK(alike.ambiguous);
  CHECK(alike.placement.rotation.isIdentity(1e-3));
  const Mesh table = test::appended(legs, ball(1, 0.3, 0.15));
  const Alignment found = align(table, shaken(table), {});
  CHECK(found.lies_on);
  CHECK_FALSE(found.ambiguous);
  CHECK(found.placement.rotation.isIdentity(1e-3));
  // A marker decides: one leg onto the next.
  const Alignment marked = align(legs, shaken(legs), {{0, legs.vertex_count() / 4}});
  CHECK(marked.lies_on);
  CHECK_FALSE(marked.placement.rotation.isIdentity(0.5));
}

static void check_a_part_cut_off(const Mesh& whole) {
  std::vector<char> keep;
  for (int j = 0; j < whole.triangle_count(); ++j)
    keep.push_back(triangle_centre(whole.positions, whole.triangles, j)[0] > 0.5);
  const Mesh part = test::kept(whole, keep);
  REQUIRE(part.triangle_count() < whole.triangle_count() / 4);
  for (const bool back : {false, true}) {
    const Mesh &source = back ? part : whole, &target = back ? whole : part;
    const Alignment found = align(source, target, {});
    CHECK(found.lies_on);
    CHECK_FALSE(found.ambiguous);
    CHECK(test::largest_error(found.placement.all(source.positions), source.positions) < 1e-9);
    const AabbTree there(target);
    const auto has_a_counterpart = [&](Index v) {
      return there.nearest(source.positions.row(v).transpose(), 1e-6, [](int) { return true; })
                 .triangle >= 0;
    };
    const Positions fitted = register_onto(source, target, {}, found, {});
    CHECK(test::mean_error(fitted, source.positions, has_a_counterpart) < 1e-3);
  }
  // A part with an origin, unit and axes of its own is found by the stance that is given.
  Similarity own;
  own.rotation = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, -1).normalized()).toRotationMatrix();
  own.scale = 40;
  own.shift << 7, -3, 100;
  const Mesh moved = {own.all(part.positions), part.triangles};
  for (const bool back : {false, true}) {
    const Mesh &source = back ? moved : whole, &target = back ? whole : moved;
    const Similarity stance = back ? own.inverse() : own;
    const Alignment found = align(source, target, {}, 0, {}, &stance);
    CHECK(found.lies_on);
    CHECK(test::largest_error(found.placement.all(source.positions), stance.all(source.positions)) <
          1e-9 * stance.scale);
    CHECK_FALSE(align(source, target, {}).lies_on);
    Similarity mirrored = stance;
    mirrored.mirrored = true;
    CHECK_FALSE(align(source, target, {}, 0, {}, &mirrored).lies_on);
  }
  // A marker at another place overrides the stance.
  Index low = 0;
  whole.positions.col(0).minCoeff(&low);
  CHECK_FALSE(align(whole, moved, {{static_cast<int>(low), 0}}, 0, {}, &own).lies_on);
  const Alignment marked = align(whole, part, {{static_cast<int>(low), 0}});
  CHECK(test::largest_error(marked.placement.all(whole.positions), whole.positions) > 0.05);
}

TEST_CASE("a part that was cut off is found where it stands, and so is the whole from the part") {
  check_a_part_cut_off(test::beast(3));
}

TEST_CASE("a part that was cut off of a finer mesh is found where it stands", "[large]") {
  check_a_part_cut_off(test::beast(4));
}

TEST_CASE("what is tiny lies on a surface by its own size, not because it is near") {
  const Mesh whole = test::beast(4);
  Mesh crumb = test::grid(12, 12, [](double x, double y) { return 0.5 * std::cos(9 * x) * y; });
  crumb.positions.rowwise() -= crumb.positions.colwise().mean();
  Similarity stance;  // places the crumb in the surface, at a thousandth of the surface's size
  stance.scale = 0.001 * bounding_box_diagonal(whole.positions);
  stance.shift = whole.positions.row(77).transpose();
  CHECK_FALSE(align(crumb, whole, {}, 0, {}, &stance).lies_on);
  const Similarity back = stance.inverse();
  CHECK_FALSE(align(whole, crumb, {}, 0, {}, &back).lies_on);
}
