// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "base/bound_surface.h"

namespace dd {

/// The joint rigid motion of all handles: that which fits their motion from rest best (least
/// squares). If no fixed vertex is adjacent to a free one, each example's own motion is undone
/// before examples are compared and blended, and the result gets that of the handles. So a
/// rigid motion of all handles moves the result by that motion.
///
/// Each handle counts once, by the mean of its vertices. Where the means are collinear or coincide,
/// the handles' own rotations decide the rest. It is continuous in the pose, except where
/// two rotations fit equally well.
struct JointRigidMotion {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  /// Mean of the handles' means, at rest and in the pose.
  Eigen::RowVector3d from = Eigen::RowVector3d::Zero(), to = from;

  Eigen::RowVector3d apply(const Eigen::RowVector3d& position) const {
    return (position - from) * rotation.transpose() + to;
  }
  Eigen::RowVector3d undo(const Eigen::RowVector3d& position) const {
    return (position - to) * rotation + from;
  }
};

/// The joint rigid motions of the handles and of the examples of a bound surface.
class JointRigidMotions {
 public:
  explicit JointRigidMotions(const BoundSurface& bound);

  /// Whether a fixed vertex shares a triangle with a free one, or there is no handle. Then all
  /// motions are the identity.
  bool fixed() const { return fixed_; }
  /// The motion of the handles. offsets: displacement of their rows, in BoundSurface::order().
  /// linear: linear part of each handle's matrix. free: for each handle, whether its rotation is to
  /// be ignored; or empty.
  JointRigidMotion of(const Rows& offsets, const std::vector<Eigen::Matrix3d>& linear,
                      const std::vector<char>& free) const;
  /// The examples with their motions undone, n×3 each.
  std::vector<Positions> examples() const;
  /// The motion of each example.
  const std::vector<JointRigidMotion>& of_examples() const { return of_examples_; }
  double bytes() const;

 private:
  template <class PositionOf>
  JointRigidMotion fit(const PositionOf& position_of, const std::vector<Eigen::Matrix3d>& linear,
                       const std::vector<char>& free) const;

  const BoundSurface& bound_;
  bool fixed_;
  std::vector<std::vector<int>> vertices_;  // by handle
  std::vector<JointRigidMotion> of_examples_;
};

}  // namespace dd
