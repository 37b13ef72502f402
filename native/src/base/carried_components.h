// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "base/bound_surface.h"
#include "reconstruction/gradients.h"

namespace dd {

/// Places components without constrained vertices on a base from outside. (14) leaves their
/// translation open; it is chosen so that each keeps its mean offset from its base,
///
///   Σ_j A_j c'_j = Σ_j A_j (b'_j + R_j (c_j − b_j))
///
/// with c_j, b_j the centroids of triangle j on S and on B, A_j its area on S, R_j the rotation of
/// its gradient from B to B'.
class CarriedComponents {
 public:
  explicit CarriedComponents(const BoundSurface& bound);

  /// base: B', all rows. offsets: the displacement of S; each such component is translated.
  void place(const Rows& base, Rows& offsets);

 private:
  struct Carried {
    std::vector<int> rows;
    std::vector<int> triangles;  // indices into the arrays below
  };
  const BoundSurface& bound_;
  std::vector<Carried> components_;
  Triangles triangles_;  // corners are rows in order()
  std::vector<double> areas_;
  Positions centroid_offsets_;  // c_j − b_j
  std::vector<RotationBlock<double>> rotation_blocks_;
  Rows rotations_;
};

}  // namespace dd
