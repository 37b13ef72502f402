// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <limits>
#include <utility>

#include "reconstruction/factored_surface.h"

namespace dd {

/// The arms r of CrossSections. Turns displacements of the surface into those of the centres, and
/// back: c' − c = (p' − p) − (R r − r). Without arms both are the same.
class CrossSectionArms {
 public:
  explicit CrossSectionArms(const FactoredSurface& surface) : surface_(surface) {}

  /// arms: by active index, or without rows.
  void set(Positions arms) {
    arms_ = std::move(arms);
    displacements_ = Rows::Zero(arms_.rows(), 4);
    posed_.resize(0, 3);
  }
  bool empty() const { return arms_.rows() == 0; }

  /// Sets R. quaternions q: by active index, of any length. R r − r = 2 (w (v × r) + v × (v × r)) /
  /// |q|², with v and w the parts of q; without a rotation, q = 0, that is 0.
  template <class Real>
  void turn(const Real* quaternions) {
    surface_.poisson->pool().parallel_for(
        arms_.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
          for (int64_t i = begin; i < end; ++i) {
            if (row(i) >= surface_.order().fixed_begin) continue;  // those don't move
            const Real* const q = quaternions + 4 * i;
            const double* const r = arms_.data() + 3 * i;
            double* const displacement = displacements_.data() + 4 * i;
            const double x = q[0], y = q[1], z = q[2], w = q[3];
            const double square = x * x + y * y + z * z + w * w;
            const double scale = 2 / std::max(square, std::numeric_limits<double>::min());
            const double cx = y * r[2] - z * r[1], cy = z * r[0] - x * r[2],
                         cz = x * r[1] - y * r[0];
            displacement[0] = scale * (w * cx + y * cz - z * cy);
            displacement[1] = scale * (w * cy + z * cx - x * cz);
            displacement[2] = scale * (w * cz + x * cy - y * cx);
          }
        });
  }
  /// R r − r: rows by active index.
  const Rows& displacements() const { return displacements_; }
  /// Takes the arms as they are turned for those of a pose, from which before() is; or not.
  void take_pose() {
    posed_ = arms_;
    for (Index i = 0; i < posed_.rows(); ++i) posed_.row(i) += displacements_.row(i).head<3>();
  }
  void leave_pose() { posed_.resize(0, 3); }

  /// The arm r of an active vertex.
  Eigen::Vector3d at_rest(Index i) const { return arms_.row(i).transpose(); }
  /// The same in the pose, if one was taken.
  Eigen::Vector3d before(Index i) const {
    return (posed_.rows() > 0 ? posed_.row(i) : arms_.row(i)).transpose();
  }
  /// R r
  Eigen::Vector3d after(Index i) const {
    return (arms_.row(i) + displacements_.row(i).head<3>()).transpose();
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
    add(-1, offsets);
    solve();
    add(1, offsets);
  }

  double bytes() const {
    return static_cast<double>((arms_.size() + displacements_.size() + posed_.size()) *
                               Index(sizeof(double)));
  }

 private:
  Index row(int64_t active_index) const {
    return surface_.poisson->active_row(static_cast<int>(active_index));
  }
  void add(double sign, Rows& offsets) const {
    surface_.poisson->pool().parallel_for(arms_.rows(), kLeastRange,
                                          [&](int64_t begin, int64_t end) {
                                            for (int64_t i = begin; i < end; ++i)
                                              offsets.row(row(i)) += sign * displacements_.row(i);
                                          });
  }

  const FactoredSurface& surface_;
  Positions arms_;
  Rows displacements_;  // R r − r
  Positions posed_;     // without rows: rest
};

}  // namespace dd
