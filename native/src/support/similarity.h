// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

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

/// Finds the similarity that takes weighted points next to others: its rotation is that of least
/// squares, and its scale makes their spread alike. Points on a line are not turned.
Similarity fitted_similarity(const Positions& from, const Positions& to,
                             const Eigen::VectorXd& weights);

/// Finds how two meshes stand to each other, whatever their shapes. Where the points fit exactly,
/// or the fitted rotation is more than 20° off all 24 rotations that take axes to axes, the result
/// is that of fitted_similarity(). Else a rotation between different shapes is taken for a
/// difference of shape, and the nearest of the 24 is used in its place.
Similarity fitted_stance(const Positions& from, const Positions& to,
                         const Eigen::VectorXd& weights);

/// The 24 rotations that take axes to axes, the identity first.
std::vector<Eigen::Matrix3d> rotations_of_axes();

}  // namespace dd
