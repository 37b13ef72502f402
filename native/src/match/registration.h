// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "match/alignment.h"
#include "support/progress.h"

namespace dd {

struct RegistrationOptions {
  /// Weights of Sumner and Popović 2004: gradients of neighbours alike, and near the identity.
  double smoothness = 1;
  double identity = 1e-3;
  /// In each stage the pull to the target grows and the system is factored anew; in each of its
  /// rounds nearest points are found anew and the system is solved.
  int stages = 8;
  int rounds = 3;
  /// Of the target's box: no point further away pulls, and no triangles further apart correspond.
  double reach = 0.1;
  int threads = 0;  ///< 0: as many as the machine has, at most 8
};

/// The source deformed onto the target, n×3, in the target's units (Sumner and Popović 2004, §5):
/// over the vertices and the fourth points of the source, minimizes
///
///   w_S Σ_adjacent ‖T_i − T_j‖² + w_I Σ ‖T_j − I‖² + w_C Σ ‖v'_i − c_i‖²
///
/// with the markers held on their partners, from w_C = 0 on growing. c_i is the nearest point of
/// the target whose normal is less than a right angle off; where there is none within reach, or
/// only on an open border while v_i is on none, v'_i is held back by its present place, so that the
/// system stays the same. w_C is chosen by the length of the waves that follow the target in each
/// stage, from the size of the box down to a few edges: independent of units and of the number of
/// triangles. While waves are long c_i is drawn, too, by what of the target has its nearest point
/// next to the vertex (GoalFinder::both_ways()).
///
/// It begins where the alignment has the source. Where markers place it, too, another fit begins
/// there by them alone; where the alignment has tips of limbs, one that takes these to their
/// partners while waves are long; and the one is taken that makes more correspond with confidence.
/// Where the alignment has a map, which copes with poses, yet another takes c_i from it while waves
/// are long, and is taken where that stretches less.
///
/// Where the source lies on the target but for parts that one of them lacks, w_C falls with the
/// distance of c_i, and is small where there is none within reach: what has no counterpart goes
/// with what has.
///
/// markers: any number of pairs of vertices. Throws Error(argument) for markers out of range or
/// contradictory; Error(cancelled).
Positions register_onto(const Mesh& source, const Mesh& target, const Pairs& markers,
                        const Alignment& alignment, const RegistrationOptions& options,
                        const Progress& progress = {});
/// The same after align().
Positions register_onto(const Mesh& source, const Mesh& target, const Pairs& markers,
                        const RegistrationOptions& options, const Progress& progress = {});

}  // namespace dd
