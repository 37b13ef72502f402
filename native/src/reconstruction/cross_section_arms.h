// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>

#include "kernels/kernels.h"
#include "reconstruction/factored_surface.h"

namespace dd {

/// The arms r of CrossSections. Turns displacements of the surface into those of the centres, and
/// back: c' − c = (p' − p) − (R r − r). Without arms both are the same.
class CrossSectionArms {
 public:
  explicit CrossSectionArms(const FactoredSurface& surface) : surface_(surface) {}

  /// arms: by active index, or without rows.
  void set(const Positions& arms) {
    arms_ = Rows::Zero(arms.rows(), 4);
    arms_.leftCols<3>() = arms;
    displacements_ = Rows::Zero(arms.rows(), 4);
    posed_.resize(0, 3);
    moving_ = 0;  // those of fixed rims come last
    while (moving_ < arms.rows() && row(moving_) < surface_.order().fixed_begin) ++moving_;
  }
  bool empty() const { return arms_.rows() == 0; }

  /// Sets R. quaternions: by active index, of any length; zeros are no rotation.
  template <class Real>
  void turn(const Real* quaternions) {
    surface_.poisson->pool().parallel_for(moving_, kLeastRange, [&](int64_t begin, int64_t end) {
      kernels().of<Real>().turn_vectors(static_cast<int>(end - begin), quaternions + 4 * begin,
                                        arms_.data() + 4 * begin,
                                        displacements_.data() + 4 * begin);
    });
  }
  /// R r − r: rows by active index.
  const Rows& displacements() const { return displacements_; }
  /// Takes the arms as they are turned for those of a pose, from which before() is; or not.
  void take_pose() { posed_ = arms_.leftCols<3>() + displacements_.leftCols<3>(); }
  void leave_pose() { posed_.resize(0, 3); }

  /// The arm r of an active vertex.
  Eigen::Vector3d at_rest(Index i) const { return arms_.row(i).head<3>().transpose(); }
  /// The same in the pose, if one was taken.
  Eigen::Vector3d before(Index i) const {
    return posed_.rows() > 0 ? Eigen::Vector3d(posed_.row(i)) : at_rest(i);
  }
  /// R r
  Eigen::Vector3d after(Index i) const {
    return (arms_.row(i) + displacements_.row(i)).head<3>().transpose();
  }
  /// positions: of the surface at rest or in the pose, rows in its order. Returns those of the
  /// centres.
  Rows centres(Rows positions) const {
    for (Index i = 0; i < arms_.rows(); ++i) positions.row(row(i)).head<3>() -= before(i);
    return positions;
  }

  /// Calls solve() with the centres' displacements in place of the surface's.
  template <class Solve>
  void solve_for_centres(Rows& offsets, const Solve& solve) const {
    add(-1, 0, offsets);
    solve();
    add(1, 0, offsets);
  }
  /// The same for a solve() that reads the constrained rows alone.
  template <class Solve>
  void solve_anew_for_centres(Rows& offsets, const Solve& solve) const {
    add(-1, surface_.order().free_count, offsets);
    solve();
    add(1, 0, offsets);
  }

  double bytes() const {
    return static_cast<double>((arms_.size() + displacements_.size() + posed_.size()) *
                               Index(sizeof(double)));
  }

 private:
  Index row(int64_t active_index) const {
    return surface_.poisson->active_row(static_cast<int>(active_index));
  }
  void add(double sign, Index first, Rows& offsets) const {
    surface_.poisson->pool().parallel_for(std::max<Index>(0, moving_ - first), kLeastRange,
                                          [&](int64_t begin, int64_t end) {
                                            for (int64_t i = first + begin; i < first + end; ++i)
                                              offsets.row(row(i)) += sign * displacements_.row(i);
                                          });
  }

  const FactoredSurface& surface_;
  Rows arms_, displacements_;  // r, R r − r
  Index moving_ = 0;           // how many of them aren't fixed
  Positions posed_;            // without rows: rest
};

}  // namespace dd
