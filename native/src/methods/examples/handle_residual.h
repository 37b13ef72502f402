// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "base/bound_surface.h"

namespace dd {

/// What handles ask for beyond a pose of S, as smooth as the base's functions: for each handle the
/// affine motion that takes its vertices nearest to where they are to be, spread by
/// HandleExtension.
class HandleResidual {
 public:
  /// bound: with a base of its own, not one from outside; it must outlive this.
  explicit HandleResidual(const BoundSurface& bound);

  /// posed: the displacement of all rows in BoundSurface::order(). offsets: in: the handles' rows,
  /// out: the free ones, the pose's moved by the residual.
  void spread(const Rows& posed, Rows& offsets) const;

 private:
  struct Handle {
    std::vector<int> rows;    // of its vertices
    Eigen::MatrixXd inverse;  // 4×n: of their places about the handle's centre, and 1
  };
  const BoundSurface& bound_;
  std::vector<Handle> handles_;
};

}  // namespace dd
