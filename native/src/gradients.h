// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "kernels.h"
#include "mesh.h"

namespace dd {

/// For each triangle of the base the one whose motion from B to B' gives its S_j (15): itself, or,
/// where it has no area to speak of and (15) has no inverse, the nearest triangle across shared
/// edges, or else vertices, that has. -1 where a whole part has none: its S_j is the identity.
///
/// "No area": longest edge under 1e-9 of size, or height over it under 1e-2 of it: a
/// flatter one turns the rounding of B into a rotation. Chosen over
/// clamping because a neighbour's S_j is still exact for rigid and affine motions of the base.
/// size: of the surface S, whose base may have collapsed.
struct GradientSources {
  std::vector<int> of_triangle;
  int borrowed_count = 0;
};
GradientSources gradient_sources(const Positions& base, const Triangles& triangles, double size);

/// A pass over triangles that turns base positions into the right-hand side div(S_jᵀ) of (14).
class GradientPass {
 public:
  GradientPass() = default;
  /// base: B at rest, n×3. corner_flux: corner_divergence() of S, 3m×3. active: triangles to visit.
  /// source_row: n, the row of a vertex in the base positions given to add_to.
  /// target_row: n, the row of a vertex in the right-hand side (constrained ones share a spare
  /// row).
  GradientPass(const Positions& base, const Triangles& triangles, const Positions& corner_flux,
               const std::vector<int>& active, const GradientSources& sources,
               const std::vector<int>& source_row, const std::vector<int>& target_row,
               int spare_row);

  /// Adds S_j · flux of each triangle's corners. base, right_hand_side: rows of 4 doubles.
  void add_to(double* right_hand_side, const double* base, bool rotation_only) const;

  double bytes() const { return static_cast<double>(blocks_.size() * sizeof(TriangleBlock)); }

 private:
  std::vector<TriangleBlock> blocks_;
};

}  // namespace dd
