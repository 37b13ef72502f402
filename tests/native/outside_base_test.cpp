// SPDX-License-Identifier: GPL-3.0-or-later
// T-base: B and B' given from outside.
#include <Eigen/Dense>
#include <limits>

#include "cases.h"
#include "catch.h"
#include "deform.h"
#include "dense_reference.h"
#include "mesh/intersections.h"
#include "mesh/measures.h"

using namespace dd;
using test::Affine;
using test::by;

namespace {

Positions surface_over(Deformer& deformer, const Positions& deformed_base,
                       const UpdateOptions& options, const std::vector<Affine>& handles = {}) {
  std::vector<double> matrices;
  for (const Affine& matrix : handles)
    matrices.insert(matrices.end(), matrix.data(), matrix.data() + 12);
  return deformer.mesh().positions + deformer.update(matrices.data(), options, &deformed_base);
}

/// A rough ball over a smooth one, nothing held.
struct CoveredBall {
  Mesh mesh = test::rough_sphere(3, 0.1);
  Positions base = mesh.positions.rowwise().normalized() * 0.8;
  std::vector<int> roles = std::vector<int>(static_cast<size_t>(mesh.vertex_count()), kFree);
  BindOptions options() const {
    BindOptions result;
    result.base = base;
    return result;
  }
};

Positions warped(const Positions& p) {
  Positions result = p;
  for (Index v = 0; v < p.rows(); ++v)
    result.row(v) << p(v, 0) + 0.4 * p(v, 2) * p(v, 2), 1.2 * p(v, 1), p(v, 2) - 0.3 * p(v, 0);
  return result;
}

const std::vector<UpdateOptions> kAll = {by(MethodKind::detail), by(MethodKind::detail, false),
                                         by(MethodKind::detail, true, 4), by(MethodKind::normal),
                                         by(MethodKind::variational)};

}  // namespace

TEST_CASE("an outside base at rest leaves the surface at rest, by every method") {
  const CoveredBall ball;
  Deformer deformer(ball.mesh, ball.roles, 0, ball.options());
  CHECK(deformer.region().free_count() == ball.mesh.vertex_count());
  for (const UpdateOptions& options : kAll)
    CHECK(test::largest_difference(surface_over(deformer, ball.base, options),
                                   ball.mesh.positions) < 1e-9);
}

TEST_CASE("a rigid motion of an outside base moves the surface rigidly") {
  const CoveredBall ball;
  Deformer deformer(ball.mesh, ball.roles, 0, ball.options());
  const Affine motion = test::rotation_about(2.1, {1, 2, 0.5}, {0.2, 0, 0}, {0.3, -1, 2});
  const Positions expected = test::transformed(motion, ball.mesh.positions);
  for (const UpdateOptions& options : kAll) {
    if (options.method == MethodKind::variational) continue;  // isn't rotation-invariant
    CHECK(test::largest_difference(
              surface_over(deformer, test::transformed(motion, ball.base), options), expected) <
          1e-9);
  }
}

TEST_CASE("two parts that nothing holds are carried each by its own base") {
  const CoveredBall ball;
  const Mesh both = test::appended(ball.mesh, ball.mesh);
  const int n = ball.mesh.vertex_count();
  Positions base(2 * n, 3), moved(2 * n, 3), expected(2 * n, 3);
  base << ball.base, ball.base;
  const Affine first = test::rotation_about(0.7, {1, 2, 0.5}, {0, 0, 0}, {0.3, -1, 2});
  const Affine second = test::rotation_about(-1.7, {0, 2, 0.5}, {0, 1, 0}, {4, 0, 2});
  moved << test::transformed(first, ball.base), test::transformed(second, ball.base);
  expected << test::transformed(first, ball.mesh.positions),
      test::transformed(second, ball.mesh.positions);
  BindOptions options;
  options.base = base;
  Deformer deformer(both, std::vector<int>(size_t(2 * n), kFree), 0, options);
  CHECK(test::largest_difference(surface_over(deformer, moved, by(MethodKind::detail)), expected) <
        1e-9);
}

TEST_CASE("with constrained vertices it is (14) with the given base's gradients: dense solve") {
  const CoveredBall ball;
  auto roles = test::roles_by_height(ball.mesh, -0.6, 0.8);
  const Positions moved = warped(ball.base);
  const Affine turn = test::rotation_about(0.3, {0, 1, 0}, {0, 0, 1}, {0.1, 0, 0.1});
  const Mesh& mesh = ball.mesh;
  const auto dense = test::dense_operators(mesh.positions, mesh.triangles);
  BindOptions how = ball.options();
  how.triangulation = Triangulation::given;
  Deformer deformer(mesh, roles, 1, how);
  for (bool rotation_only : {true, false}) {
    Eigen::MatrixXd gradients(3 * mesh.triangles.rows(), 3);
    for (Index j = 0; j < mesh.triangles.rows(); ++j) {
      Eigen::Matrix3d S = test::deformation_gradient(ball.base, moved, mesh.triangles, j);
      if (rotation_only) S = test::polar_rotation(S);
      gradients.middleRows<3>(3 * j) = S.transpose();
    }
    Positions held = mesh.positions;
    for (int v = 0; v < mesh.vertex_count(); ++v)
      if (roles[v] == 0) held.row(v) = test::transformed(turn, held.row(v));
    const Positions expected =
        test::dense_solve(dense.L, held, roles, dense.G.transpose() * dense.D * gradients);
    CHECK(test::largest_difference(
              surface_over(deformer, moved, by(MethodKind::detail, rotation_only), {turn}),
              expected) < 1e-9);
  }
}

TEST_CASE("the computed base given as one from outside makes no difference") {
  const auto plane = test::lifted_plane(61);
  Deformer computed(plane.mesh, plane.roles, 1, {});
  const Positions expected = test::surface(computed, {plane.motion});
  BindOptions options;
  options.base = computed.base();
  Deformer given(plane.mesh, plane.roles, 1, options);
  CHECK(test::largest_difference(
            surface_over(given, computed.deformed_base(), by(MethodKind::detail), {plane.motion}),
            expected) < 1e-9);
}

TEST_CASE("showing an outside base, and a base that is missing or not finite") {
  const CoveredBall ball;
  Deformer deformer(ball.mesh, ball.roles, 0, ball.options());
  const Positions moved = warped(ball.base);
  CHECK(test::largest_difference(surface_over(deformer, moved, test::shown_base()), moved) < 1e-12);
  CHECK_THAT(test::refusal([&] { deformer.update(nullptr, {}); }, Status::argument),
             contains("deformed base"));
  Positions bad = moved;
  bad(7, 1) = std::numeric_limits<double>::quiet_NaN();
  CHECK_THAT(test::refusal([&] { surface_over(deformer, bad, {}); }, Status::argument),
             contains("not finite"));
}

TEST_CASE("Fig. 4: a cylinder over a base of half its radius, bent explicitly over a short length",
          "[large]") {
  struct Found {
    Measures normal, whole, rotations, volumes;
  };
  const auto found_at = [](double degrees) {
    const auto figure = test::cylinder_of_figure_4(degrees);
    const std::vector<int> roles(static_cast<size_t>(figure.mesh.vertex_count()), kFree);
    const std::vector<char> free(roles.size(), 1);
    BindOptions options;
    options.base = figure.base;
    Deformer deformer(figure.mesh, roles, 0, options);
    const auto measured = [&](const UpdateOptions& update) {
      return measure(figure.mesh, surface_over(deformer, figure.deformed_base, update), free);
    };
    return Found{measured(by(MethodKind::normal)), measured(by(MethodKind::detail, false)),
                 measured(by(MethodKind::detail, true)), measured(by(MethodKind::volumes))};
  };
  const Mesh mesh = test::cylinder_of_figure_4(0).mesh;
  CHECK(mesh.triangle_count() == 9900);
  CHECK(intersecting_pairs(mesh).empty());
  for (double degrees : {90.0, 120.0, 150.0}) {
    INFO(degrees << " degrees");
    const auto figure = test::cylinder_of_figure_4(degrees);
    CHECK(intersecting_pairs({figure.deformed_base, mesh.triangles}).empty());
    const Found found = found_at(degrees);
    CHECK(found.normal.intersecting_triangles > 100);
    if (degrees == 90) CHECK(found.whole.intersecting_triangles == 0);
    CHECK(found.rotations.intersecting_triangles == 0);
    CHECK(found.volumes.intersecting_triangles == 0);
    CHECK(found.volumes.volume_ratio == Approx(1).margin(0.05));
    CHECK(found.rotations.volume_ratio < 0.95);  // transfer does not try to keep it
  }
}

TEST_CASE("refined over an outside base that turns by more than a whole turn: no seam") {
  const test::Case tube = test::bent_cylinder();
  BindOptions options;
  options.base = tube.mesh.positions;
  Deformer deformer(tube.mesh, std::vector<int>(tube.roles.size(), kFree), 0, options);
  Positions twisted = tube.mesh.positions;
  for (Index v = 0; v < twisted.rows(); ++v) {
    const Eigen::AngleAxisd turn(6 * twisted(v, 2), Eigen::Vector3d::UnitZ());
    twisted.row(v) = (turn * Eigen::Vector3d(twisted.row(v))).transpose();
  }
  // A seam where the gauge's signs meet would lie elsewhere after a turn of everything.
  const Affine turn = test::rotation_about(2.9, {1, 0.4, 0.2}, {0, 0, 0}, {0, 0, 0});
  const UpdateOptions refined = test::usual();
  const Positions expected = test::transformed(turn, surface_over(deformer, twisted, refined));
  const Positions result = surface_over(deformer, test::transformed(turn, twisted), refined);
  CHECK(test::largest_difference(result.rowwise() - result.row(0),
                                 expected.rowwise() - expected.row(0)) < 1e-9);
}
