// SPDX-License-Identifier: GPL-3.0-or-later
// The error of frames in single precision, and that threads change nothing.
#include <cmath>
#include <memory>

#include "cases.h"
#include "catch.h"
#include "deform.h"

using namespace dd;
using test::Affine;

namespace {

struct Example {
  std::string name;
  Mesh mesh;
  std::vector<int> roles;
  Affine motion;
};

/// A plane of triangles as thin as 1 : 500, with edges of very different lengths.
Mesh thin_plane(int side) {
  Mesh mesh = test::bumpy_plane(side, 5);
  for (Index v = 0; v < mesh.positions.rows(); ++v) {
    const double y = mesh.positions(v, 1);
    mesh.positions(v, 1) = 0.02 * y + 0.98 * std::pow(y, 6);
  }
  return mesh;
}

std::vector<Example> examples() {
  std::vector<Example> result;
  for (const test::Case& one : test::survey_cases())
    result.push_back({one.name, one.mesh, one.roles, one.motion});
  const Affine turn = test::rotation_about(1.2, {1, 0.3, 0.2}, {0, 0, 0}, {0.1, 0.2, 0.5});
  for (int level : {4, 5}) {
    const Mesh ball = test::rough_sphere(level, 0.2);
    result.push_back({"rough ball", ball, test::roles_by_height(ball, -0.8, 0.8), turn});
  }
  for (int side : {41, 201}) {
    const int last = side - 1 - side / 10;
    result.push_back({"plane " + std::to_string(side), test::bumpy_plane(side, 9),
                      test::strip_roles(side, side, side / 10, last), turn});
  }
  result.push_back({"thin triangles", thin_plane(121), test::strip_roles(121, 121, 8, 112), turn});
  Mesh far = test::bumpy_plane(61, 6);
  far.positions.rowwise() += Eigen::RowVector3d(900, -400, 30);
  result.push_back({"far from the origin", far, test::strip_roles(61, 61, 6, 54),
                    test::rotation_about(1.2, {1, 0.3, 0.2}, {900, -400, 30}, {0, 0, 0.5})});
  return result;
}

std::unique_ptr<Deformer> bound(const Example& one, Precision precision, int threads = 1) {
  BindOptions options;
  options.precision = precision;
  options.threads = threads;
  return std::make_unique<Deformer>(one.mesh, one.roles, 1, options);
}

}  // namespace

TEST_CASE("single precision stays within 1e-5 of the box of double", "[large]") {
  for (const Example& one : examples()) {
    const auto full = bound(one, Precision::full), single = bound(one, Precision::single);
    const double box = bounding_box_diagonal(one.mesh.positions);
    for (const auto& how : {test::by(MethodKind::detail, true), test::by(MethodKind::detail, false),
                            test::by(MethodKind::detail, true, 4)}) {
      INFO(one.name << ", refined " << how.of_method.refined.iterations);
      const double error = test::largest_difference(test::surface(*single, {one.motion}, how),
                                                    test::surface(*full, {one.motion}, how));
      CHECK(error < 1e-5 * box);
      CHECK(error > 0);  // it was computed in single precision
    }
  }
}

TEST_CASE("single precision is exact at rest and doesn't depend on the number of threads",
          "[threads][large]") {
  for (const Example& one : examples()) {
    INFO(one.name);
    const auto alone = bound(one, Precision::single), three = bound(one, Precision::single, 3);
    for (int refine : {0, 4}) {
      const auto how = test::by(MethodKind::detail, true, refine);
      CHECK(test::largest_difference(test::surface(*alone, {one.motion}, how),
                                     test::surface(*three, {one.motion}, how)) == 0);
      CHECK(test::largest_difference(test::surface(*alone, {test::identity()}, how),
                                     one.mesh.positions) <
            1e-12 * bounding_box_diagonal(one.mesh.positions) +
                1e-15 * one.mesh.positions.cwiseAbs().maxCoeff());
    }
  }
}

TEST_CASE("the Poisson system refines where single precision alone is too far off") {
  // A long strip that is held at its ends.
  const int length = 80001;
  const Mesh strip =
      test::grid(length, 3, [](double x, double) { return 0.01 * std::sin(60 * x); });
  const auto roles = test::strip_roles(length, 3, 1, length - 1);
  const Region region = make_region(strip, roles, 1);
  const auto operators = surface_operators(strip.positions, strip.triangles);
  ThreadPool pool(2);
  BlockOptions options;
  options.pool = &pool;
  const SparseMatrix block = free_block(operators.laplacian, region);
  const Dissection dissection = free_dissection(block, region, strip.positions);
  options.dissection = &dissection;
  PoissonSystem full(strip, region, operators, block, options);
  REQUIRE(full.precision() == Precision::full);
  options.precision = Precision::single;
  PoissonSystem single(strip, region, operators, block, options);
  CHECK(single.correction_steps() > 0);
  const auto solved = [&](PoissonSystem& system) {
    const RowOrder& order = system.order();
    Rows offsets = Rows::Zero(order.count(), 4);
    for (int r = order.free_count; r < order.fixed_begin; ++r) offsets.row(r) << 0.3, 0, 1, 0;
    system.extend(offsets);
    Positions result(order.count(), 3);
    for (int r = 0; r < order.count(); ++r)
      result.row(order.vertex_of_row[r]) = offsets.row(r).head<3>();
    return result;
  };
  const Positions expected = solved(full);
  // A harmonic function along a strip is linear in its length.
  CHECK(std::abs(expected(3 * (length / 2) + 1, 2) - 0.5) < 0.05);
  CHECK(test::largest_difference(solved(single), expected) < 1e-6);
}
