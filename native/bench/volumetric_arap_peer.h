// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "support/types.h"
#include "tapered_limb.h"

namespace dd::bench {

struct VolumetricArapResult {
  Positions positions;  ///< of the limb's surface
  int tets = 0, iterations = 0;
  double factor_ms = 0, iteration_ms = 0;
};

/// As-rigid-as-possible deformation of a solid limb (Chao, Pinkall, Sanan and Schröder 2010): the
/// surface filled with tetrahedra between its centre line and itself, Σ_j volume_j ‖S_j − R_j‖²
/// minimized in alternating steps on the library's own solids (TetPoisson), until one moves
/// vertices by less than 1e-5 of their norm, at most 2000 times. It starts from the handle's screw
/// motion, spread evenly along the limb, so whole turns are in it from the beginning. turn: the
/// rotation vector of the motion, with whole turns.
VolumetricArapResult deform_with_volumetric_arap(const test::TaperedLimb& limb, int layers,
                                                 const test::Affine& motion,
                                                 const Eigen::Vector3d& turn);

}  // namespace dd::bench
