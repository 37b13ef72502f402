// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "reconstruction/factored_surface.h"

namespace dd {

/// The rotation of each triangle in each example as a rotation vector r_ij = log R_ij, R_ij the
/// rotation of S_ij (15) from S at rest to example i. A triangle without area, at rest or in the
/// example, takes the rotation of its stand-in.
///
/// The logarithm of a rotation is unique only up to whole turns. It is chosen to be continuous over
/// the surface, so that a limb may turn by more than 180° along its length. Each component starts
/// at the triangle that turns least. If some have a fixed corner, it is one of these, as others may
/// have made a whole turn back to the identity. The choice propagates to neighbours by a priority
/// queue: across edges first, those with the most similar rotations first, and across single
/// vertices only where no edge remains. So creased and folded places come last and can't mislead
/// others.
///
/// From 180° on the logarithm is ill-conditioned: near 360° a small tilt of the rotation, as from
/// shear, flips its axis. There only the twist about the neighbour's axis is taken, and the swing
/// is dropped if it is less than half a radian.
class ExampleLogarithms {
 public:
  /// For the triangles with a corner that isn't fixed. examples: n×3 each.
  ExampleLogarithms(const FactoredSurface& surface, const std::vector<Positions>& examples);

  Eigen::Vector3d at(int example, int triangle) const {
    return logarithms_[example].row(row_of_triangle_[triangle]).transpose();
  }
  double bytes() const;

 private:
  std::vector<int>
      row_of_triangle_;  // row in logarithms_ of each triangle; -1: all corners are fixed
  std::vector<Positions> logarithms_;  // r_ij, for each example
};

}  // namespace dd
