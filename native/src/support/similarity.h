// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "support/types.h"

namespace dd {

/// A rotation, scale and shift.
struct Similarity {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  double scale = 1;
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
  bool mirrored = false;  ///< when fitted: a reflection would have fitted better

  Eigen::Vector3d operator()(const Eigen::Vector3d& point) const {
    return scale * (rotation * point) + shift;
  }
};

/// The similarity that takes points next to others, weighted: the rotation of least squares, and
/// the scale that makes their spread alike. Points on a line are not turned.
Similarity fitted_similarity(const Positions& from, const Positions& to,
                             const Eigen::VectorXd& weights);

/// The same with a rotation that tells how two meshes stand, not how their shapes differ: where the
/// points don't fit exactly and the rotation is less than 20° off one of the 24 that take axes to
/// axes, that one.
Similarity fitted_stance(const Positions& from, const Positions& to,
                         const Eigen::VectorXd& weights);

}  // namespace dd
