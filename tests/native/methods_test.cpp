// SPDX-License-Identifier: GPL-3.0-or-later
#include <Eigen/Dense>

#include "cases.h"
#include "catch.h"
#include "deform.h"
#include "dense_reference.h"
#include "measures.h"
#include "rotations.h"

using namespace dd;
using test::Affine;
using test::by;
using test::surface;

namespace {

const std::vector<Affine> kMotions = {
    test::rotation_about(0.6, {1, 0.3, 0}, {0, 0, 1}, {0.2, 0.1, 0.4}),
    test::rotation_about(-0.4, {0, 1, 1}, {0, 1, 0}, {0, 0.3, 0})};

/// A rough ball fixed below with two handles.
struct Ball {
  Mesh mesh = test::rough_sphere(2, 0.15);
  std::vector<int> roles = test::roles_by_height(mesh, -0.5, 0.7);
  Ball() {
    for (Index v = 0; v < mesh.positions.rows(); ++v)
      if (mesh.positions(v, 1) > 0.95) roles[v] = 1;
  }
};

/// exp(log R) by series: another way than the core's axis and angle.
Eigen::Matrix3d series_exponential(const Eigen::Matrix3d& A) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Identity(), term = sum;
  for (int k = 1; k < 30; ++k) {
    term = term * A / k;
    sum += term;
  }
  return sum;
}

}  // namespace

TEST_CASE("VARIATIONAL is the direct bi-Laplacian solve on S, whatever the base's metric") {
  const Ball ball;
  for (BaseMetric metric : {BaseMetric::surface, BaseMetric::base}) {
    Deformer deformer(ball.mesh, ball.roles, 2, {metric, 0});
    const auto dense = test::dense_transfer(ball.mesh, ball.roles, kMotions, false, true);
    CHECK(test::largest_difference(surface(deformer, kMotions, by(MethodKind::variational)),
                                   dense.variational) < 1e-9);
  }
}

TEST_CASE("GRADIENT equals a dense solve with weights, logarithms and gradients of its own") {
  const Ball ball;
  std::vector<Affine> handles = kMotions;
  handles[0].leftCols<3>() *= Eigen::Vector3d(1.3, 0.8, 1.1).asDiagonal();
  handles[1].leftCols<3>() *= 0.7;
  const auto dense = test::dense_operators(ball.mesh.positions, ball.mesh.triangles);
  const int n = ball.mesh.vertex_count(), m = ball.mesh.triangle_count();
  const Eigen::MatrixXd none = Eigen::MatrixXd::Zero(n, 3);
  Positions indicator = Positions::Zero(n, 3), held = ball.mesh.positions;
  for (int v = 0; v < n; ++v) {
    if (ball.roles[v] < 0) continue;
    indicator(v, ball.roles[v]) = 1;
    held.row(v) = test::transformed(handles[ball.roles[v]], held.row(v));
  }
  const Positions weights = test::dense_solve(dense.L, indicator, ball.roles, none);
  const Eigen::MatrixXd G = dense.G * ball.mesh.positions;
  Deformer deformer(ball.mesh, ball.roles, 2, {});
  for (bool rotation_only : {true, false}) {
    Eigen::MatrixXd gradients(3 * m, 3);
    for (int j = 0; j < m; ++j) {
      Eigen::Matrix3d turn = Eigen::Matrix3d::Zero(), stretch = Eigen::Matrix3d::Identity();
      for (int h = 0; h < 2; ++h) {
        double w = 0;
        for (int k = 0; k < 3; ++k) w += weights(ball.mesh.triangles(j, k), h) / 3;
        const Eigen::Matrix3d A = handles[h].leftCols<3>();
        const Eigen::Matrix3d R = test::polar_rotation(A);
        const double angle = std::acos((R.trace() - 1) / 2);
        turn += w * angle / (2 * std::sin(angle)) * (R - R.transpose());
        stretch += w * (R.transpose() * A - Eigen::Matrix3d::Identity());
      }
      Eigen::Matrix3d S = series_exponential(turn);
      if (!rotation_only) S *= stretch;
      gradients.middleRows<3>(3 * j) = G.middleRows<3>(3 * j) * S.transpose();
    }
    const Positions expected =
        test::dense_solve(dense.L, held, ball.roles, dense.G.transpose() * dense.D * gradients);
    const Positions result = surface(deformer, handles, by(MethodKind::gradient, rotation_only));
    CHECK(test::largest_difference(result, expected) < 1e-9);
  }
}

TEST_CASE("GRADIENT: a translation leaves the gradients alone, the flaw that the paper explains") {
  const auto plane = test::lifted_plane(61);
  Deformer deformer(plane.mesh, plane.roles, 1, {});
  const Positions result = surface(deformer, {plane.motion}, by(MethodKind::gradient));
  // With the gradients of S, p' is p and a harmonic displacement: VarMin of order 1.
  Deformer membrane(plane.mesh, plane.roles, 1, {BaseMetric::surface, 0, Smoothness::membrane});
  CHECK(test::largest_difference(
            result, surface(membrane, {plane.motion}, by(MethodKind::variational))) < 1e-9);
}

TEST_CASE(
    "every method but VARIATIONAL follows handles that all turn together, resting gives rest") {
  const auto plane = test::lifted_plane(61);
  std::vector<int> roles = plane.roles;
  for (int& role : roles) role = role == kFree ? kFree : role == kFixed ? 0 : 1;
  Deformer deformer(plane.mesh, roles, 2, {});
  const Affine motion = test::rotation_about(0.7, {1, 2, 0.5}, {0.2, 0, 0}, {0.3, -1, 2});
  const Positions expected = test::transformed(motion, plane.mesh.positions);
  for (MethodKind method : {MethodKind::transfer, MethodKind::gradient, MethodKind::variational})
    for (bool rotation_only : {true, false}) {
      const UpdateOptions options = by(method, rotation_only);
      CHECK(
          test::largest_difference(surface(deformer, {test::identity(), test::identity()}, options),
                                   plane.mesh.positions) < 1e-10);
      const double missed =
          test::largest_difference(surface(deformer, {motion, motion}, options), expected);
      // VarMin's own flaw: p is not in the operator's null space.
      CHECK((method == MethodKind::variational ? missed > 1e-3 : missed < 1e-9));
    }
}

TEST_CASE("methods share a deformer without leaving traces in each other's results") {
  const Ball ball;
  const std::vector<UpdateOptions> all = {by(MethodKind::transfer),
                                          by(MethodKind::variational),
                                          by(MethodKind::gradient),
                                          by(MethodKind::transfer, true, 3),
                                          {MethodKind::transfer, {true, 0}, Shown::base}};
  std::vector<Positions> alone;
  for (const UpdateOptions& options : all) {
    Deformer fresh(ball.mesh, ball.roles, 2, {});
    alone.push_back(surface(fresh, kMotions, options));
  }
  Deformer shared(ball.mesh, ball.roles, 2, {});
  for (int round = 0; round < 2; ++round)
    for (size_t k = 0; k < all.size(); ++k)
      CHECK(test::largest_difference(surface(shared, kMotions, all[k]), alone[k]) == 0);
}

TEST_CASE("showing the base gives B at rest and B' in a pose") {
  const Ball ball;
  Deformer deformer(ball.mesh, ball.roles, 2, {});
  const UpdateOptions shown = {MethodKind::transfer, {true, 4}, Shown::base};
  CHECK(test::largest_difference(surface(deformer, {test::identity(), test::identity()}, shown),
                                 deformer.base()) < 1e-12);
  const auto dense = test::dense_transfer(ball.mesh, ball.roles, kMotions, false, true);
  CHECK(test::largest_difference(surface(deformer, kMotions, shown), dense.base_deformed) < 1e-9);
}

TEST_CASE("a part whose base collapses turns with the handle that alone holds it") {
  const Mesh ball = test::rough_sphere(3, 0.1);
  const Affine turn = test::rotation_about(std::acos(0.0), {0, 1, 0}, {0.3, 0, 0}, {0, 0, 2});
  const Positions turned = test::transformed(turn, ball.positions);
  std::vector<int> two(static_cast<size_t>(ball.vertex_count()), kFree);
  two[0] = two[1] = 0;
  SECTION("by two vertices") {
    Deformer deformer(ball, two, 1, {});
    for (int refine : {0, 3})
      CHECK(test::largest_difference(
                surface(deformer, {turn}, by(MethodKind::transfer, true, refine)), turned) < 1e-8);
    CHECK(deformer.borrowed_count() == ball.triangle_count());
  }
  SECTION("by three vertices in a line") {
    Mesh strip = test::bumpy_plane(21, 2);
    std::vector<int> roles(21 * 21, kFree);
    for (int k : {0, 10, 20}) roles[21 * 10 + k] = 0;
    Deformer deformer(strip, roles, 1, {});
    CHECK(test::largest_difference(surface(deformer, {turn}),
                                   test::transformed(turn, strip.positions)) < 1e-8);
  }
  SECTION("with its scale where that is asked for") {
    Affine scaled = turn;
    scaled.leftCols<3>() *= 1.5;
    Deformer deformer(ball, two, 1, {});
    CHECK(test::largest_difference(surface(deformer, {scaled}, false),
                                   test::transformed(scaled, ball.positions)) < 1e-8);
  }
  SECTION("one vertex has no rotation to give") {
    two[1] = kFree;
    Deformer deformer(ball, two, 1, {});
    const Positions shift = surface(deformer, {turn}) - ball.positions;
    CHECK((shift.rowwise() - shift.row(0)).cwiseAbs().maxCoeff() < 1e-8);
  }
}

TEST_CASE("what fails on another geometry than the mesh's is not blamed on the mesh") {
  const auto plane = test::lifted_plane(41);
  const auto blame = [&](const BindOptions& options) {
    return test::refusal([&] { Deformer(plane.mesh, plane.roles, 1, options); }, Status::numeric);
  };
  CHECK_THAT(blame({BaseMetric::surface, 1e9}), contains("lower the smoothing"));
}
