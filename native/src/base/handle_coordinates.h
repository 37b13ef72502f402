// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "support/types.h"
#include "systems/region.h"

namespace dd {

/// The mean position of each handle's vertices, h×3.
Positions handle_centres(const Region& region, const Positions& positions);

/// Coordinates of handle vertices in which the displacement by an affine motion is linear. An
/// affine motion x ↦ A x moves a vertex x of the handle by
///
///   (x − o, 1) C,   C = [(A_lin − I)ᵀ; A o − o], 4×3,
///
/// with o the handle's centre, the mean of its vertices, as origin for accuracy. If all vertices of
/// the handle lie in a plane, on a line or in one point, some of x − o are redundant. Then only the
/// coordinates along principal axes with non-zero extent remain, and C is reduced accordingly.
class HandleCoordinates {
 public:
  HandleCoordinates() = default;
  HandleCoordinates(const Region& region, const Positions& positions);

  const Positions& centres() const { return centres_; }  ///< h×3
  /// Number of coordinates of all handles, index of a handle's first, number of a handle's.
  int count() const { return begin_.back(); }
  int begin(int handle) const { return begin_[handle]; }
  int count(int handle) const { return begin_[handle + 1] - begin_[handle]; }

  /// The coordinates of a vertex of this handle at the given rest position, 1×count(handle).
  Eigen::Matrix<double, 1, Eigen::Dynamic, Eigen::RowMajor, 1, 4> at(
      const Eigen::RowVector3d& position, int handle) const;

  /// The count(handle)×4 matrix T with (x − o, 1) = at(x) T for every vertex x of the handle.
  using Reduction = Eigen::Matrix<double, Eigen::Dynamic, 4, Eigen::RowMajor, 4, 4>;
  Reduction reduction(int handle) const;
  /// coefficients: the stacked blocks C of all handles, 4h×k. Returns the stacked T C, count()×k.
  RowMatrix reduced(const RowMatrix& coefficients) const;

 private:
  using Axes = Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::ColMajor, 3, 3>;

  Positions centres_;
  std::vector<Axes> axes_;
  std::vector<int> begin_{0};
};

}  // namespace dd
