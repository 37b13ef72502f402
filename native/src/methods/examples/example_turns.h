// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "reconstruction/factored_surface.h"

namespace dd {

/// How each example turns each triangle: r_ij = log R_ij, R_ij the rotation of S_ij (15) from S at
/// rest to the example. A triangle without area, at rest or there, takes the rotation of the one
/// that stands in for it.
///
/// A rotation has many logarithms, which differ by whole turns. They are chosen to be continuous
/// over the surface, so that a limb may turn by more than half a turn along its length. The choice
/// begins, in each component, at the triangle that turns least; where there are triangles beside
/// fixed vertices it is one of these, because another may be back from a whole turn. From there it
/// spreads to neighbours, first across the edges whose two triangles turn most alike, and across
/// single vertices only where no edge leads on. Breadth first would do where an example is smooth;
/// this order leaves what is creased or folded to the end, where it can't lead others astray.
///
/// Beyond half a turn the logarithm exaggerates: towards a whole one the least tilt of a rotation,
/// as a shear gives, turns its axis over. There only the turn about the neighbour's axis is taken,
/// and the tilt left out where it is less than half a radian.
class ExampleTurns {
 public:
  /// Of the triangles with a corner that isn't fixed. examples: n×3 each.
  ExampleTurns(const FactoredSurface& surface, const std::vector<Positions>& examples);

  Eigen::Vector3d at(int example, int triangle) const {
    return turns_[example].row(place_[triangle]).transpose();
  }
  double bytes() const;

 private:
  std::vector<int> place_;        // of each triangle; -1: not among them
  std::vector<Positions> turns_;  // by example
};

}  // namespace dd
