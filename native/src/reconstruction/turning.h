// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "reconstruction/gradient_source.h"

namespace dd {

/// How far the handles turn the surface, and how refinement takes that into account.
struct Turning {
  /// Quaternions from which refined rotations take their signs: rows of 4 in the surface's order,
  /// with like signs at neighbours and within half a turn of the surface's rotations. Null: no part
  /// turns by more than half a turn.
  const Rows* gauge = nullptr;
  /// No such field is known, as with a base from outside: signs are propagated from vertex to
  /// vertex of the unrefined result.
  bool unknown = false;
  /// Weight of refinement, 0 to 1. It falls with far turns, where refinement would pinch the inside
  /// of a bend and thin a twisted limb to a thread.
  double share = 1;
  /// Rotations that are known without a base, and the weight, 0 to 1, of their solution in the
  /// result that is refined. They serve where the base is as thin as a thread and so determines the
  /// bending badly.
  const GradientSource* known = nullptr;
  const Rows* known_rotations = nullptr;  ///< the same as quaternions, rows in the surface's order
  double known_share = 0;

  /// Computes the result that is refined: the mean of by_base() and solve_by(*known), which both
  /// write to offsets, weighted by known_share.
  template <class ByBase, class SolveBy>
  void solve(const ByBase& by_base, const SolveBy& solve_by, Rows& offsets) const {
    // Blending would keep NaNs that an earlier pose left in offsets.
    if (known_share == 1) return solve_by(*known);
    by_base();
    if (known_share == 0) return;
    const Rows without = offsets;
    solve_by(*known);
    offsets = without + known_share * (offsets - without);
  }
};

}  // namespace dd
