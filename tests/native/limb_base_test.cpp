// SPDX-License-Identifier: GPL-3.0-or-later
// The base of solid limbs as it is shown.
#include <algorithm>

#include "catch.h"
#include "deform.h"
#include "tapered_limb.h"

using namespace dd;
using namespace dd::test;

namespace {

UpdateOptions shown(double solidity = 1, const Eigen::Vector3d& turn = Eigen::Vector3d::Zero()) {
  UpdateOptions options = solid(solidity, turn);
  options.output = Output::base;
  return options;
}

}  // namespace

TEST_CASE("the base of a solid limb shows it without its relief, wherever it is moved") {
  for (const int density : {1, 2, 3}) {
    const TaperedLimb limb(0.4, 0.2, 1, density, 0.08);
    Deformer deformer(limb.mesh, limb.roles, 1, {});
    const double least[] = {0.85, 0.85, 0.75, 0.8, 0.75};
    const std::pair<Affine, Eigen::Vector3d> poses[] = {
        {identity(), {0, 0, 0}},
        {TaperedLimb::twist(90), {0, 0, radians(90)}},
        {TaperedLimb::twist(720), {0, 0, radians(720)}},
        {TaperedLimb::bend(120), {0, radians(120), 0}},
        {TaperedLimb::led_down(), {0, 0, 0}}};
    for (int i = 0; i < 5; ++i) {
      const Positions p = surface(deformer, {poses[i].first}, shown(1, poses[i].second));
      INFO("density " << density << ", pose " << i);
      CHECK(limb.least_section(p) > least[i]);
    }
    // A ring half-way up is a circle, of which the relief was 8%.
    const Positions p = surface(deformer, {identity()}, shown());
    const Positions ring = p.middleRows(Index(limb.rings / 2) * limb.sides, limb.sides);
    const Eigen::VectorXd radii = (ring.rowwise() - ring.colwise().mean().eval()).rowwise().norm();
    CHECK(radii.maxCoeff() < 1.01 * radii.minCoeff());
    CHECK(radii.mean() == Approx(0.3).epsilon(0.05));
  }
}

TEST_CASE("the shown base of a limb: rigid motions, Solidity 0 and sheets") {
  const TaperedLimb limb(0.5, 0.06, 0.7);
  TaperedLimb held = limb;
  for (int& role : held.roles)
    if (role == kFixed) role = 1;
  Deformer both(held.mesh, held.roles, 2, {});
  const Affine motion = rotation_about(2.5, {1, -2, 0.5}, {0, 0, 1}, {3, 4, 5});
  UpdateOptions options = shown();
  options.turns.assign(6, 0.0);
  const Positions rest = surface(both, {identity(), identity()}, options),
                  moved = surface(both, {motion, motion}, options);
  CHECK(largest_difference(moved, (rest * motion.leftCols<3>().transpose()).rowwise() +
                                      motion.col(3).transpose()) < 1e-6 * TaperedLimb::kLength);

  Deformer deformer(limb.mesh, limb.roles, 1, {});
  const Positions with_limbs = surface(deformer, {TaperedLimb::led_down()}, shown());
  const Positions skin = surface(deformer, {TaperedLimb::led_down()}, shown(0));
  CHECK(largest_difference(skin, deformer.deformed_base()) < 1e-12);
  // Half as solid is half of the way.
  const Positions half = surface(deformer, {TaperedLimb::led_down()}, shown(0.5)),
                  thread = deformer.deformed_base();
  const double all = largest_difference(with_limbs, thread);
  CHECK(largest_difference(half, thread) == Approx(all / 2).epsilon(0.05));

  const Case sheet = lifted_plane(41);
  Deformer of_sheet(sheet.mesh, sheet.roles, 1, {});
  const Positions lifted = surface(of_sheet, {sheet.motion}, shown());
  CHECK(largest_difference(lifted, of_sheet.deformed_base()) < 1e-12);
}
