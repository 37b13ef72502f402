// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "support/types.h"
#include "systems/region.h"

namespace dd {

/// The mean of each handle's vertices, h×3.
Positions handle_centres(const Region& region, const Positions& positions);

/// The coordinates in which the motions of handles are told, for each about its centre o, the mean
/// of its vertices, for accuracy: an affine motion x ↦ A x moves a vertex x of the handle by
///
///   (x − o, 1) C,   C = [(A_lin − I)ᵀ; A o − o], 4×3.
///
/// Where all its vertices lie in a plane, on a line or in one point, as many of the first three say
/// nothing; those that are left are along axes of its own, and C is reduced to them.
class HandleCoordinates {
 public:
  HandleCoordinates() = default;
  HandleCoordinates(const Region& region, const Positions& positions);

  const Positions& centres() const { return centres_; }  ///< h×3
  /// Of all handles together, and where those of one begin.
  int count() const { return begin_.back(); }
  int begin(int handle) const { return begin_[handle]; }
  int count(int handle) const { return begin_[handle + 1] - begin_[handle]; }

  /// The values of one handle's coordinates at one of its own vertices, 1×count(handle).
  Eigen::Matrix<double, 1, Eigen::Dynamic, Eigen::RowMajor, 1, 4> at(
      const Eigen::RowVector3d& position, int handle) const;

  /// count(handle)×4, with which (x − o, 1) is at(x) times it.
  using Reduction = Eigen::Matrix<double, Eigen::Dynamic, 4, Eigen::RowMajor, 4, 4>;
  Reduction reduction(int handle) const;
  /// Of the blocks C of all handles, 4h×k: count()×k.
  RowMatrix reduced(const RowMatrix& coefficients) const;

 private:
  using Axes = Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::ColMajor, 3, 3>;

  Positions centres_;
  std::vector<Axes> axes_;
  std::vector<int> begin_{0};
};

}  // namespace dd
