// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "match/alignment.h"
#include "support/progress.h"

namespace dd {

struct RegistrationOptions {
  /// w_S and w_I (Sumner and Popović 2004): the weights of the difference between neighbours'
  /// gradients, and of the gradients' difference from the identity.
  double smoothness = 1;
  double identity = 1e-3;
  /// Each stage increases w_C and factors the system again; each of its rounds finds closest points
  /// again and solves.
  int stages = 8;
  int rounds = 3;
  /// As a fraction of the diagonal of the target's box: points farther away don't attract, and
  /// triangles farther apart don't correspond.
  double reach = 0.1;
  int threads = 0;  ///< 0: as many as the machine has, at most 8
};

/// The source deformed onto the target, n×3, in the target's units (Sumner and Popović 2004, §5).
/// Minimizes, over the vertices and fourth points of the source,
///
///   w_S Σ_adjacent ‖T_i − T_j‖² + w_I Σ ‖T_j − I‖² + w_C Σ ‖v'_i − c_i‖²
///
/// with the markers held at their partners and w_C growing from stage to stage. c_i is the closest
/// point of the target with a normal less than 90° off. If there is none within reach, or it is on
/// an open border and v_i isn't, c_i is the present position of v_i, which leaves the matrix as it
/// is. w_C = (2π / λ)⁴ in the target's unit box, with λ from the box's diagonal in the first stage
/// to four edges of the source in the last one. λ is not the length of the shortest waves that
/// follow the target, which depends on the source's mean edge length h in that box, too: w_S is the
/// weight of a pair of triangles and not of an area, so that a wave of length Λ costs h² (2π / Λ)⁴
/// a vertex. Measured on spheres with ripples, half of a wave's height is followed at about Λ =
/// 0.93 λ √h, for 2,000 to 32,000 triangles: at λ = 1 that is a sixth of the diagonal with 2,000
/// triangles and an eleventh with 32,000. In the last stage all waves that the source resolves are
/// followed. While λ is long, the target's vertices with a closest point beside v_i contribute to
/// c_i (GoalFinder::both_ways()).
///
/// Several fits are made, of which the first begins at the alignment's placement. If there is one
/// by markers, a second fit begins there, by the markers alone at first. If the alignment has tips
/// of limbs, a fit holds these at their partners while λ is long. The fit with the highest mean
/// confidence (match_triangles()) is kept. If the alignment has a map, which tolerates poses, a
/// last fit takes c_i from it in its first stage, and is kept instead if it stretches the source
/// less.
///
/// If the surfaces lie on each other except for parts that one of them lacks, w_C falls with the
/// distance to c_i, and is small for vertices without a closest point. So parts without a
/// counterpart follow those with one.
///
/// markers: any number of pairs of vertices. Throws Error(argument) for markers out of range or
/// contradictory; Error(cancelled).
Positions register_onto(const Mesh& source, const Mesh& target, const Pairs& markers,
                        const Alignment& alignment, const RegistrationOptions& options,
                        const Progress& progress = {});
/// Calls align() and then the above.
Positions register_onto(const Mesh& source, const Mesh& target, const Pairs& markers,
                        const RegistrationOptions& options, const Progress& progress = {});

}  // namespace dd
