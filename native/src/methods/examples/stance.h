// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "base/bound_surface.h"

namespace dd {

/// The joint rigid motion of all handles: that which fits their motion from rest best (least
/// squares). If no fixed vertex is adjacent to a free one, each example's own stance is removed
/// before examples are compared and blended, and the result gets the stance of the handles. So a
/// rigid motion of all handles moves the result by that motion.
///
/// Each handle counts once, by the mean of its vertices. Where the means are collinear or coincide,
/// the handles' own rotations decide the rest. The stance is continuous in the pose, except where
/// two rotations fit equally well.
struct Stance {
  Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
  /// Mean of the handles' means, at rest and in the pose.
  Eigen::RowVector3d from = Eigen::RowVector3d::Zero(), to = from;

  Eigen::RowVector3d put(const Eigen::RowVector3d& place) const {
    return (place - from) * turn.transpose() + to;
  }
  Eigen::RowVector3d take_back(const Eigen::RowVector3d& place) const {
    return (place - to) * turn + from;
  }
};

/// The stances of the handles and of the examples of a bound surface.
class Stances {
 public:
  explicit Stances(const BoundSurface& bound);

  /// Whether a fixed vertex shares a triangle with a free one, or there is no handle. Then all
  /// stances are the identity.
  bool fixed() const { return fixed_; }
  /// The stance of the handles. offsets: displacement of their rows, in BoundSurface::order().
  /// linear: linear part of each handle's matrix. free: for each handle, whether its rotation is to
  /// be ignored; or empty.
  Stance of(const Rows& offsets, const std::vector<Eigen::Matrix3d>& linear,
            const std::vector<char>& free) const;
  /// The examples with their stances removed, n×3 each.
  std::vector<Positions> examples() const;
  /// The stance of each example.
  const std::vector<Stance>& of_examples() const { return of_examples_; }
  double bytes() const;

 private:
  template <class PlaceOf>
  Stance fit(const PlaceOf& place_of, const std::vector<Eigen::Matrix3d>& linear,
             const std::vector<char>& free) const;

  const BoundSurface& bound_;
  bool fixed_;
  std::vector<std::vector<int>> vertices_;  // by handle
  std::vector<Stance> of_examples_;
};

}  // namespace dd
