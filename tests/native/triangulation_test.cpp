// SPDX-License-Identifier: GPL-3.0-or-later
// How a deformation depends on the triangulation of a shape: as little as possible.
#include "cases.h"
#include "catch.h"
#include "deform.h"
#include "limbs.h"
#include "solver/symbolic_cholesky.h"
#include "systems/energy_block.h"
#include "systems/free_block.h"
#include "triangulations.h"

using namespace dd;
using test::Affine;
using test::by;
using test::largest_difference;
using test::surface;

namespace {

const std::vector<UpdateOptions> kWays = {
    by(MethodKind::detail), by(MethodKind::detail, false), test::usual(),
    test::shown_base(),     by(MethodKind::variational),   by(MethodKind::gradient),
    by(MethodKind::normal), by(MethodKind::volumes),       by(MethodKind::detail, true, 16),
};

BindOptions way(Triangulation triangulation) {
  BindOptions options;
  options.triangulation = triangulation;
  return options;
}

Positions deformed(const Mesh& mesh, const test::Case& one, const UpdateOptions& how,
                   Triangulation triangulation = Triangulation::delaunay) {
  Deformer deformer(mesh, one.roles, 1, way(triangulation));
  return surface(deformer, {one.motion}, how);
}

UpdateOptions turned_by(UpdateOptions options, BaseDeformer deformer) {
  options.base_deformer = deformer;
  return options;
}

}  // namespace

TEST_CASE("TRIANGULATION: slivers in the flat faces of a bar change nothing", "[large]") {
  const test::Case bar = test::twisted_bar();
  const Mesh slivers = test::with_slivers(bar.mesh);
  for (const UpdateOptions& how :
       {by(MethodKind::detail), by(MethodKind::detail, false), test::usual(),
        turned_by(test::usual(), BaseDeformer::motions), test::shown_base(),
        by(MethodKind::variational), by(MethodKind::gradient)}) {
    const Positions expected = deformed(bar.mesh, bar, how);
    CHECK(largest_difference(deformed(slivers, bar, how), expected) < 1e-9);
    CHECK(largest_difference(deformed(slivers, bar, how, Triangulation::given), expected) > 5e-3);
  }
}

TEST_CASE("TRIANGULATION: on curved shapes Delaunay flips take nine tenths of slivers' effect") {
  for (const test::Case& one : {test::bent_cylinder(), test::lifted_plane(61)}) {
    const Mesh slivers = test::with_slivers(one.mesh, 0.2);
    const Positions expected = deformed(one.mesh, one, test::usual());
    const double now = largest_difference(deformed(slivers, one, test::usual()), expected);
    const double before =
        largest_difference(deformed(slivers, one, test::usual(), Triangulation::given), expected);
    INFO(one.name << ": " << now << ", by the slivers themselves " << before);
    CHECK(now < 0.1 * before);
  }
}

TEST_CASE("TRIANGULATION: whatever the slivers, rest is rest and a rigid motion is exact") {
  test::Case one = test::bent_cactus();
  const Mesh slivers = test::with_slivers(one.mesh, 0.5);
  Deformer resting(slivers, one.roles, 1, {});
  Deformer held(slivers, test::held_by_one(one.roles), 1, {});
  const Affine motion = test::rotation_about(0.9, {1, 2, 0.5}, {0, 0, 1}, {0.4, 0, -0.3});
  const Positions expected = test::transformed(motion, slivers.positions);
  for (const UpdateOptions& how : kWays) {
    INFO("method " << static_cast<int>(how.method) << ", refined "
                   << how.of_method.refined.iterations);
    if (how.output == Output::result)
      CHECK(largest_difference(surface(resting, {test::identity()}, how), slivers.positions) <
            1e-9);
    // VARIATIONAL isn't rotation-invariant; NORMAL and VOLUMES are as exact as their iterations.
    if (how.method == MethodKind::detail && how.output == Output::result)
      CHECK(largest_difference(surface(held, {motion}, how), expected) < 1e-8);
  }
}

TEST_CASE("TRIANGULATION: pose by example is the same in other triangles of flat faces") {
  const test::Case bar = test::twisted_bar();
  const Mesh slivers = test::with_slivers(bar.mesh);
  const auto posed = [&](const Mesh& mesh) {
    Positions example = mesh.positions;
    for (Index v = 0; v < example.rows(); ++v)
      example.row(v) = test::transformed(
          test::rotation_about(0.8 * example(v, 2), {0, 0, 1}, {0, 0, 0}, {0, 0, 0}),
          example.row(v));
    Deformer deformer(mesh, bar.roles, 1, test::with({example}));
    return surface(deformer, {bar.motion}, test::posed_by({0.6}));
  };
  CHECK(largest_difference(posed(slivers), posed(bar.mesh)) < 1e-9);
}

TEST_CASE("TRIANGULATION: a plane of needles alone bends as one of squares does") {
  const auto made = [](int columns, int rows) {
    test::Case one;
    one.mesh = test::grid(columns, rows, [](double, double) { return 0.0; });
    for (Index v = 0; v < one.mesh.positions.rows(); ++v) {
      const double x = one.mesh.positions(v, 0);
      one.roles.push_back(x < 0.1 + 1e-9 ? kFixed : x > 0.9 - 1e-9 ? 0 : kFree);
    }
    one.motion = test::rotation_about(test::radians(60), {0, 1, 0}, {0.95, 0.5, 0}, {0, 0, 0.25});
    return one;
  };
  const test::Case squares = made(61, 61), needles = made(1201, 7);  // 1 : 200
  const Positions expected = deformed(squares.mesh, squares, test::usual()),
                  result = deformed(needles.mesh, needles, test::usual());
  double largest = 0;
  for (int i = 0; i <= 60; ++i)
    for (int j = 0; j <= 6; ++j)
      largest =
          std::max(largest, (result.row(20 * i * 7 + j) - expected.row(i * 61 + 10 * j)).norm());
  INFO(largest);
  CHECK(largest < 0.01);
}

TEST_CASE("TRIANGULATION: the factors of flipped triangles are as small as those of good ones") {
  const test::Case plane = test::lifted_plane();
  const auto entries = [&](const Mesh& mesh) {
    const Region region = make_region(mesh, plane.roles, 1);
    const auto operators =
        surface_operators(mesh.positions, mesh.triangles, Triangulation::delaunay);
    const SparseMatrix poisson = free_block(operators.laplacian, region);
    const Dissection dissection = free_dissection(poisson, region, mesh.positions);
    double sum = 0;
    for (const SparseMatrix& matrix :
         {poisson, energy_block(operators, region, Smoothness::thin_plate).sparse}) {
      const SymbolicCholesky symbolic(matrix, dissection.order(matrix));
      for (int s = 0; s < symbolic.supernode_count(); ++s)
        sum += double(symbolic.width(s)) * (symbolic.width(s) + symbolic.height(s));
    }
    return sum;
  };
  CHECK(entries(test::with_slivers(plane.mesh, 0.2)) < 1.1 * entries(plane.mesh));
}

TEST_CASE("NON-MANIFOLD: sheets that meet in a line bind and deform by every method") {
  const test::Junction sheets = test::junction();
  for (const bool slivers : {false, true}) {
    const Mesh mesh = slivers ? test::with_slivers(sheets.mesh, 0.3) : sheets.mesh;
    Deformer deformer(mesh, sheets.roles, 1, {});
    Deformer held(mesh, test::held_by_one(sheets.roles), 1, {});
    const Affine lift = test::rotation_about(0.4, {0, 1, 0}, {0.5, 0.5, 0.5}, {0, 0, 0.2});
    const Affine motion = test::rotation_about(0.9, {1, 2, 0.5}, {0, 0, 1}, {0.4, 0, -0.3});
    const Positions moved = test::transformed(motion, mesh.positions);
    for (const UpdateOptions& how : kWays) {
      INFO("method " << static_cast<int>(how.method) << ", refined "
                     << how.of_method.refined.iterations << ", slivers " << slivers);
      if (how.output == Output::result)
        CHECK(largest_difference(surface(deformer, {test::identity()}, how), mesh.positions) <
              1e-9);
      const Positions result = surface(deformer, {lift}, how);
      REQUIRE(result.allFinite());
      // The bar of the T is pulled up, and no vertex goes much farther than the handle.
      const double least = how.output == Output::base ? -0.2 : -0.12;
      CHECK((result - mesh.positions).rowwise().norm().maxCoeff() < 0.5);
      CHECK(result.col(2).minCoeff() > least);
      CHECK(result(7 * 15 + 7, 2) > mesh.positions(7 * 15 + 7, 2) + 0.03);
      if (how.output == Output::base || how.method == MethodKind::variational) continue;
      CHECK(largest_difference(surface(held, {motion}, how), moved) < 1e-8);
    }
  }
}
