// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "base/bound_surface.h"

namespace dd {

/// How all handles stand together: the rigid motion that takes them nearest to where they are from
/// where they are at rest. Where nothing is fixed, examples know nothing of it: they are compared
/// and mixed as they are without their own, so that whatever turns all handles turns the result and
/// nothing else.
///
/// Handles count alike, by the means of their vertices; where these are in a line, or one, their
/// own turns decide about the rest. It is continuous but where two rotations are as near.
struct Stance {
  Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
  Eigen::RowVector3d from = Eigen::RowVector3d::Zero(), to = from;  ///< centres of all handles

  Eigen::RowVector3d put(const Eigen::RowVector3d& place) const {
    return (place - from) * turn.transpose() + to;
  }
  Eigen::RowVector3d take_back(const Eigen::RowVector3d& place) const {
    return (place - to) * turn + from;
  }
};

class Stances {
 public:
  explicit Stances(const BoundSurface& bound);

  /// Whether anything free is fixed somewhere: then there is but one stance, that at rest.
  bool fixed() const { return fixed_; }
  /// offsets: the displacement of the handles' rows, in BoundSurface::order(). linear: of each
  /// handle's matrix. free: those whose vertices don't say how they turn; or none.
  Stance of(const Rows& offsets, const std::vector<Eigen::Matrix3d>& linear,
            const std::vector<char>& free) const;
  /// The examples without their own, n×3 each.
  std::vector<Positions> examples() const;
  /// What these are.
  const std::vector<Stance>& of_examples() const { return of_examples_; }
  double bytes() const;

 private:
  template <class PlaceOf>
  Stance fit(const PlaceOf& place_of, const std::vector<Eigen::Matrix3d>& linear,
             const std::vector<char>& free) const;

  const BoundSurface& bound_;
  bool fixed_;
  std::vector<std::vector<int>> vertices_;  // of each handle
  std::vector<Stance> of_examples_;
};

}  // namespace dd
