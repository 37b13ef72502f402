// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "support/types.h"

namespace dd {

/// x ↦ scale · rotation · x + shift.
struct Similarity {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< times a reflection if mirrored
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

/// Similarity between weighted corresponding points: the least-squares rotation, never a
/// reflection, and the scale that equalizes their weighted mean square distances from the means.
/// The rotation is the identity for points on a line.
Similarity fitted_similarity(const Positions& from, const Positions& to,
                             const Eigen::VectorXd& weights);

/// Whether a reflection fits the points so much better than a rotation that no difference of shape
/// explains it. False for points in a plane, which both fit alike.
bool is_mirror_image(const Positions& from, const Positions& to, const Eigen::VectorXd& weights);

/// Points of a surface and its unit normals there, n×3 each.
struct OrientedPoints {
  Positions positions, normals;
};

/// The placement of one surface relative to another of a different shape: fitted_similarity(),
/// unless the rotation that takes most normals to their partners contradicts it, as a longer neck
/// tilts an animal's least-squares fit. If either rotation is near one of the 24 that map axes to
/// axes, the result is that one, as meshes are modelled along axes. Both tests ignore angles up to
/// 3° and count angles from 5° on fully. Mirror images get the same fit after a reflection,
/// whatever the orientation of their triangles.
Similarity fitted_placement(const OrientedPoints& from, const OrientedPoints& to,
                            const Eigen::VectorXd& weights);

/// The 24 rotations that map coordinate axes to coordinate axes, the identity first.
std::vector<Eigen::Matrix3d> rotations_of_axes();

}  // namespace dd
