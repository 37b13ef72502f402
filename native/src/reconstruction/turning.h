// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Geometry>

#include "reconstruction/gradient_source.h"
#include "support/rotations.h"

namespace dd {

/// The rotations of the handles, to be interpolated: R_h = R_0 exp(t_h) exp(r_h), with whole turns
/// in t_h.
struct HandleTurns {
  Eigen::Quaterniond reference = Eigen::Quaterniond::Identity();  ///< R_0
  RowMatrix vectors;                                              ///< h×6: t_h, r_h

  /// The rotation of interpolated vectors, six numbers. Its sign is continuous.
  Eigen::Quaterniond rotation(const double* interpolated) const {
    using Vector = Eigen::Map<const Eigen::Vector3d>;
    return reference * quaternion_by(Vector(interpolated)) *
           quaternion_by(Vector(interpolated + 3));
  }
};

/// How far the handles turn the surface, and how refinement takes that into account.
struct Turning {
  const HandleTurns* handles = nullptr;  ///< null: not known, as with a base from outside
  /// Quaternions from which refined rotations take their signs: rows of 4 in the surface's order,
  /// with like signs at neighbours and within half a turn of the surface's rotations. Null: no part
  /// turns by more than half a turn.
  const Rows* gauge = nullptr;
  /// Rises with the angle from 0, where the gauge begins to be given, to 1.
  double gauge_weight = 0;
  /// Whether signs are propagated from vertex to vertex of the unrefined result, because there is
  /// no gauge, as with a base from outside.
  bool propagate_signs = false;
  /// Weight of refinement, 0 to 1. It falls with far turns, where refinement would pinch the inside
  /// of a bend and thin a twisted limb to a thread.
  double refinement_weight = 1;
  /// Rotations given without a base, and the weight, 0 to 1, of their solution in the result that
  /// is refined. They serve where the base is as thin as a thread and so determines the bending
  /// badly.
  const GradientSource* prescribed = nullptr;
  /// The same as quaternions, rows in the surface's order.
  const Rows* prescribed_rotations = nullptr;
  double prescribed_weight = 0;

  /// Computes the result that is refined: the mean of by_base() and solve_by(*prescribed), which
  /// both write to offsets, weighted by prescribed_weight.
  template <class ByBase, class SolveBy>
  void solve(const ByBase& by_base, const SolveBy& solve_by, Rows& offsets) const {
    // Blending would keep NaNs that an earlier pose left in offsets.
    if (prescribed_weight == 1) return solve_by(*prescribed);
    by_base();
    if (prescribed_weight == 0) return;
    const Rows without = offsets;
    solve_by(*prescribed);
    offsets = without + prescribed_weight * (offsets - without);
  }
};

}  // namespace dd
