// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "support/types.h"

namespace dd {

/// A rotation, scale and shift.
struct Similarity {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< and reflection, where mirrored
  double scale = 1;
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
  bool mirrored = false;

  Eigen::Vector3d operator()(const Eigen::Vector3d& point) const {
    return scale * (rotation * point) + shift;
  }
  Similarity inverse() const {
    Similarity back;
    back.rotation = rotation.transpose();
    back.scale = 1 / scale;
    back.shift = -back.scale * (back.rotation * shift);
    back.mirrored = mirrored;
    return back;
  }
  Positions all(const Positions& points) const {
    return (scale * points * rotation.transpose()).rowwise() + shift.transpose();
  }
};

/// Finds the similarity that takes weighted points next to others: its rotation is that of least
/// squares, and its scale makes their spread alike. Points on a line are not turned. Not mirrored.
Similarity fitted_similarity(const Positions& from, const Positions& to,
                             const Eigen::VectorXd& weights);

/// Whether points are the mirror image of others, rather than the same: a reflection takes them so
/// much nearer than a rotation that it is no difference of shape. Points in a plane are not.
bool is_mirror_image(const Positions& from, const Positions& to, const Eigen::VectorXd& weights);

/// Places of a surface, and its unit normals there.
struct OrientedPoints {
  Positions places, normals;
};

/// Finds how two surfaces stand to each other, whatever their shapes: by fitted_similarity(),
/// unless it is contradicted by what takes most of the normals to their partners, as a longer neck
/// tilts an animal by its places. Where by either they are turned from one of the 24 rotations that
/// take axes to axes by no more than a difference of shape may seem to, it is that one: meshes are
/// modelled along axes. Up to 3° don't count in both, from 5° on they do. Of mirror
/// images, the same after a reflection; which way their triangles go round matters to neither.
Similarity fitted_stance(const OrientedPoints& from, const OrientedPoints& to,
                         const Eigen::VectorXd& weights);

/// The 24 rotations that take axes to axes, the identity first.
std::vector<Eigen::Matrix3d> rotations_of_axes();

}  // namespace dd
