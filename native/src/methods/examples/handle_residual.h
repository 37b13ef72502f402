// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "base/bound_surface.h"

namespace dd {

/// Extends the difference between the handles and a pose of S smoothly over the surface. For each
/// handle the affine motion that fits the differences of its vertices best (least squares) is
/// extended by HandleExtension.
class HandleResidual {
 public:
  /// bound: must have a computed base, not one from outside, and must outlive this.
  explicit HandleResidual(const BoundSurface& bound);

  /// posed: displacement of the pose, all rows in BoundSurface::order(). offsets: in: rows of the
  /// handles, out: the free rows, posed plus the extended difference.
  void extend(const Rows& posed, Rows& offsets) const;

 private:
  struct Handle {
    std::vector<int> rows;           // of its vertices
    Eigen::MatrixXd pseudo_inverse;  // 4×n: pseudo-inverse of the matrix with the rows (x − o, 1)
  };
  const BoundSurface& bound_;
  std::vector<Handle> handles_;
};

}  // namespace dd
