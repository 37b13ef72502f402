// SPDX-License-Identifier: GPL-3.0-or-later
#include "reconstruction/coarse/coarse_clamps.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <memory>

#include "cases.h"
#include "catch.h"
#include "deform.h"

using namespace dd;
using test::Affine;
using test::surface;

namespace {

/// The same surface, bound as a large one and as a small one.
struct BothWays {
  BothWays(const Mesh& mesh, const std::vector<int>& roles, int handles = 1, int threads = 2)
      : box(bounding_box_diagonal(mesh.positions)) {
    BindOptions options;
    options.precision = Precision::single;
    options.threads = threads;
    options.large_from = 0;
    large = std::make_unique<Deformer>(mesh, roles, handles, options);
    options.large_from = std::numeric_limits<int>::max();
    small = std::make_unique<Deformer>(mesh, roles, handles, options);
  }

  double box;
  std::unique_ptr<Deformer> large, small;
};

struct Differences {
  double most = 0, of_nearly_all = 0;  ///< the latter at 99% of the vertices, as fractions of box
};

Differences differences(BothWays& both, const std::vector<Affine>& motions,
                        const UpdateOptions& how) {
  const Positions found = surface(*both.large, motions, how);
  Eigen::VectorXd apart = (found - surface(*both.small, motions, how)).rowwise().norm() / both.box;
  std::sort(apart.begin(), apart.end());
  return {apart[apart.size() - 1], apart[apart.size() * 99 / 100]};
}

/// How far clamps move the surface, as a fraction of the box.
double moved_by_clamps(BothWays& both, const Affine& motion, UpdateOptions how) {
  const Positions clamped = surface(*both.small, {motion}, how);
  how.of_method.refined.rim_smoothing = 0;
  return test::largest_difference(clamped, surface(*both.small, {motion}, how)) / both.box;
}

Affine strip_motion() {
  Affine motion = test::rotation_about(0.7, {0, 1, 0.3}, {1, 0.5, 0}, {0, 0, 0});
  motion.col(3) += Eigen::Vector3d(0.05, 0, 0.2);
  return motion;
}

}  // namespace

TEST_CASE("clamps on a coarse surface are those of the surface itself") {
  const Mesh plane = test::bumpy_plane(401), ball = test::sphere(8);
  BothWays strip(plane, test::strip_roles(401, 401, 46, 355));
  BothWays limb(ball, test::roles_by_height(ball, -0.6, 0.7));
  for (BothWays* both : {&strip, &limb})
    for (const UpdateOptions& how : {test::usual(), test::usual(0), test::solid()}) {
      CHECK(moved_by_clamps(*both, strip_motion(), how) > 0.005);
      const Differences found = differences(*both, {strip_motion()}, how);
      CHECK(found.most > 1e-5);  // not the surface's own
      CHECK(found.most < 8e-4);
      CHECK(found.of_nearly_all < 2e-4);
    }
}

TEST_CASE("clamps on a coarse surface: rest and rigid motions are exact, far turns are mixed") {
  const Mesh plane = test::bumpy_plane(401);
  std::vector<int> roles = test::strip_roles(401, 401, 46, 355);
  std::replace(roles.begin(), roles.end(), kFixed, 1);
  BothWays both(plane, roles, 2);
  const Affine still = test::identity();
  CHECK(test::largest_difference(surface(*both.large, {still, still}, test::usual()),
                                 plane.positions) < 1e-12);
  const Affine rigid = strip_motion();
  CHECK(test::largest_difference(surface(*both.large, {rigid, rigid}, test::usual()),
                                 test::transformed(rigid, plane.positions)) < 1e-5);
  // Between 135 and 180 degrees a part of the clamped solution is mixed in.
  const Affine far = test::rotation_about(2.6, {1, 0, 0.2}, {1, 0.5, 0}, {0, 0, 0.2});
  CHECK(differences(both, {far, still}, test::usual()).of_nearly_all < 2e-4);
}

TEST_CASE("clamps on a coarse surface: the crease at rims is as small as by its own") {
  const Mesh plane = test::bumpy_plane(401);
  BothWays both(plane, test::strip_roles(401, 401, 46, 355));
  // The mean slope of the first row of free triangles against the fixed part, which is level.
  const auto slope = [&](const Positions& p) {
    double sum = 0;
    for (int j = 0; j < 401; ++j)
      sum += std::abs(p(46 * 401 + j, 2) - p(45 * 401 + j, 2) - plane.positions(46 * 401 + j, 2) +
                      plane.positions(45 * 401 + j, 2));
    return sum;
  };
  UpdateOptions creased = test::usual();
  creased.of_method.refined.rim_smoothing = 0;
  const std::vector<Affine> motions{strip_motion()};
  const double by_own = slope(surface(*both.small, motions, test::usual()));
  CHECK(slope(surface(*both.large, motions, test::usual())) == Approx(by_own).epsilon(0.02));
  CHECK(slope(surface(*both.small, motions, creased)) > 2 * by_own);
}

TEST_CASE("a surface with much relief between coarse vertices has clamps of its own") {
  Mesh rough = test::bumpy_plane(401);
  std::srand(5);
  rough.positions.col(2) += Eigen::VectorXd::Random(rough.positions.rows()) * 0.5 / 400;
  BothWays both(rough, test::strip_roles(401, 401, 46, 355));
  CHECK(differences(both, {strip_motion()}, test::usual()).most < 1e-5);
}
