// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "base/bound_surface.h"
#include "reconstruction/gradients.h"

namespace dd {

/// Components that nothing holds, carried by a base from outside: each keeps its mean place
/// relative to its base,
///
///   Σ_j A_j c'_j = Σ_j A_j (b'_j + R_j (c_j − b_j))
///
/// with c_j, b_j the centres of triangle j on S and on B, A_j its area on S, R_j its base's
/// rotation.
class CarriedComponents {
 public:
  explicit CarriedComponents(const BoundSurface& bound);

  /// base: B', all rows. offsets: the displacement of S, shifted as a whole in each such component.
  void place(const Rows& base, Rows& offsets);

 private:
  struct Carried {
    std::vector<int> rows;
    std::vector<int> triangles;  // indices into what follows
  };
  const BoundSurface& bound_;
  std::vector<Carried> components_;
  Triangles triangles_;  // with rows for corners
  std::vector<double> areas_;
  Positions arms_;  // c_j − b_j
  std::vector<RotationBlock<double>> blocks_;
  Rows rotations_;
};

}  // namespace dd
