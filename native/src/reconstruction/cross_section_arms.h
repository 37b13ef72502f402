// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Geometry>
#include <utility>

#include "reconstruction/factored_surface.h"

namespace dd {

/// The arms r of CrossSections in a pose. Turns displacements of the surface into those of the
/// centres, and back: c' − c = (p' − p) − (R r − r). Without arms both are the same.
class CrossSectionArms {
 public:
  explicit CrossSectionArms(const FactoredSurface& surface) : surface_(surface) {}

  /// arms: by active index, or without rows.
  void set(Positions arms) {
    arms_ = std::move(arms);
    displacements_ = Rows::Zero(arms_.rows(), 4);
  }

  /// positions: of the surface, rows in its order. Returns those of the centres.
  Rows centres(Rows positions) const {
    for (Index i = 0; i < arms_.rows(); ++i) positions.row(row(i)).head<3>() -= arms_.row(i);
    return positions;
  }

  /// Sets R. quaternions: by active index, of any length.
  template <class Real>
  void turn(const Real* quaternions) {
    surface_.poisson->pool().parallel_for(
        arms_.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
          for (int64_t i = begin; i < end; ++i) {
            if (row(i) >= surface_.order().fixed_begin) continue;  // those don't move
            const Eigen::Quaterniond q(
                Eigen::Map<const Eigen::Quaternion<Real>>(quaternions + 4 * i)
                    .template cast<double>()
                    .normalized());
            const Eigen::Vector3d arm = arms_.row(i).transpose();
            displacements_.row(i).template head<3>() = (q * arm - arm).transpose();
          }
        });
  }

  void to_centres(Rows& offsets) const { add(-1, offsets); }
  /// Calls solve() with the centres' displacements in place of the surface's.
  template <class Solve>
  void solve_for_centres(Rows& offsets, const Solve& solve) const {
    to_centres(offsets);
    solve();
    add(1, offsets);
  }

  double bytes() const {
    return static_cast<double>((arms_.size() + displacements_.size()) * Index(sizeof(double)));
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
};

}  // namespace dd
