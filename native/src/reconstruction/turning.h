// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "reconstruction/gradient_source.h"

namespace dd {

/// How far the handles turn the surface.
struct Turning {
  /// Rows of 4 in the surface's order, a field of quaternions that neighbours agree on and that
  /// comes within half a turn of what the surface does; null: no part turns by more than half a
  /// turn.
  const Rows* gauge = nullptr;
  /// That nothing is known of it, as of a base from outside: what the surface does before it is
  /// refined is followed from vertex to vertex.
  bool unknown = false;
  /// How much of the refinement is to have an effect, 0 to 1: far turns leave less and less room,
  /// and it would pinch the inside of a bend and wring a twist to a thread.
  double share = 1;
  /// Rotations that are known without a base, and how much they count in the result that is
  /// refined, 0 to 1: a base that is as thin as a thread tells little of how it bends.
  const GradientSource* known = nullptr;
  const Rows* known_rotations = nullptr;  ///< the same as quaternions, rows in the surface's order
  double known_share = 0;

  /// What is refined, into offsets: by_base() and solve_by(*known), which write there, as they
  /// count.
  template <class ByBase, class SolveBy>
  void solve(const ByBase& by_base, const SolveBy& solve_by, Rows& offsets) const {
    if (known_share == 1) return solve_by(*known);  // offsets may be no numbers, of an earlier pose
    by_base();
    if (known_share == 0) return;
    const Rows without = offsets;
    solve_by(*known);
    offsets = without + known_share * (offsets - without);
  }
};

}  // namespace dd
