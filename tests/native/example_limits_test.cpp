// SPDX-License-Identifier: GPL-3.0-or-later
#include <limits>
#include <random>

#include "catch.h"
#include "limbs.h"
#include "methods/examples/weight_limits.h"

using namespace dd;
using test::Affine;
using test::box;
using test::posed;
using test::surface;
using test::ThreePoses;
using test::with;

namespace {

constexpr double kNone = std::numeric_limits<double>::infinity();

UpdateOptions limited(const std::vector<double>& limits) {
  UpdateOptions options = posed();
  options.of_method.example_limits = limits;
  return options;
}

std::vector<double> weights(const Deformer& deformer) {
  return deformer.findings(MethodKind::examples).example_weights;
}

}  // namespace

TEST_CASE("EXAMPLES, limits: a step satisfies the conditions of Karush, Kuhn and Tucker") {
  std::mt19937 generator(7);
  std::normal_distribution<double> normal;
  for (Index count = 1; count <= 12; ++count)
    for (int trial = 0; trial < 40; ++trial) {
      const auto random = [&](Index rows, Index columns) {
        return Eigen::MatrixXd(
            Eigen::MatrixXd::NullaryExpr(rows, columns, [&] { return normal(generator); }));
      };
      const Eigen::MatrixXd A = random(count, count);
      const Eigen::MatrixXd H = A * A.transpose() + 1e-3 * Eigen::MatrixXd::Identity(count, count);
      const Eigen::VectorXd s = 3 * random(count, 1);
      Eigen::VectorXd least = -random(count, 1).cwiseAbs(), most = random(count, 1).cwiseAbs();
      for (Index i = 0; i < count; ++i) {
        const int kind = int(generator() % 6);
        if (kind == 0) least[i] = -kNone;
        if (kind == 1) most[i] = kNone;
        if (kind == 2) least[i] = 0;
        if (kind == 3) least[i] = most[i] = 0;
      }
      const Eigen::VectorXd x = limited_step(H, s, least, most);
      const Eigen::VectorXd slope = H * x + s;
      const double small = 1e-9 * (1 + s.cwiseAbs().maxCoeff() + (H * x).cwiseAbs().maxCoeff());
      for (Index i = 0; i < count; ++i) {
        REQUIRE(x[i] >= least[i]);
        REQUIRE(x[i] <= most[i]);
        if (x[i] > least[i]) REQUIRE(slope[i] < small);
        if (x[i] < most[i]) REQUIRE(slope[i] > -small);
      }
    }
}

TEST_CASE(
    "EXAMPLES, limits: weights stay within, handles are met, inactive limits change nothing") {
  const ThreePoses poses;
  const Mesh& mesh = poses.limb.mesh;
  Deformer deformer(mesh, poses.handles.roles, 3, with(poses.examples));
  const std::vector<Affine> there = poses.handles.at(mesh, poses.examples[0]);
  const Positions free = surface(deformer, there, posed());
  const std::vector<double> found = weights(deformer);
  REQUIRE(found[0] > 0.9);
  CHECK(test::largest_difference(surface(deformer, there, limited({-9, 9, -9, 9, -kNone, kNone})),
                                 free) < 1e-3 * box(mesh));

  const Positions held = surface(deformer, there, limited({0, 0.4, 0, 1, -0.1, 1}));
  const std::vector<double> within = weights(deformer);
  CHECK(within[0] == 0.4);
  CHECK(within[1] >= 0);
  CHECK(within[2] >= -0.1);
  CHECK(std::max(within[1], within[2]) <= 1);
  CHECK(test::largest_difference(held, free) > 0.01 * box(mesh));
  for (Index v = 0; v < held.rows(); ++v) {
    const int role = poses.handles.roles[size_t(v)];
    if (role >= 0)
      CHECK((held.row(v) - test::transformed(there[size_t(role)], mesh.positions).row(v)).norm() <
            1e-6 * box(mesh));
  }
  surface(deformer, there, limited({0, 0, -kNone, kNone, -kNone, kNone}));
  CHECK(weights(deformer)[0] == 0);
  CHECK_THROWS_AS(surface(deformer, there, limited({0, 1})), Error);
}

TEST_CASE("EXAMPLES, limits: the result is a continuous function of the handles") {
  const ThreePoses poses;
  const Mesh& mesh = poses.limb.mesh;
  Deformer deformer(mesh, poses.handles.roles, 3, with(poses.examples));
  // From rest to the first example and as far again, beyond the limit of its weight.
  const auto at = [&](double t) {
    std::vector<Affine> motions = poses.handles.at(mesh, poses.limb.bent(1e-3 + 120 * t, 0.5));
    return surface(deformer, motions, limited({0, 0.6, 0, 0.6, 0, 0.6}));
  };
  const auto largest_step = [&](int steps) {
    double largest = 0, most = 0;
    Positions last = at(0);
    for (int k = 1; k <= steps; ++k) {
      const Positions next = at(double(k) / steps);
      largest = std::max(largest, test::largest_difference(next, last));
      for (const double weight : weights(deformer)) {
        CHECK(weight >= 0);
        CHECK(weight <= 0.6);
        most = std::max(most, weight);
      }
      last = next;
    }
    CHECK(most == 0.6);
    return largest;
  };
  const double coarse = largest_step(60), fine = largest_step(240);
  INFO(coarse << " " << fine);
  CHECK(fine < 0.4 * coarse);
  CHECK(coarse < 0.05 * box(mesh));
}
