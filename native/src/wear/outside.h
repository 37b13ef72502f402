// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "transfer/source_points.h"
#include "wear/far_sides.h"

namespace dd {

/// How far points are outside of a surface that deforms, by the patch of it that each lay over at
/// rest: with n_k the normals of the patch's triangles, a_k their corners and d_k the distance from
/// the point x to them,
///
///   f(x) = Σ_k w_k n_kᵀ (x − a_k) / Σ_k w_k,    w_k = area_k / (d_k² + ε²)²,
///
/// next to the surface the distance from its nearest triangle, and everywhere a continuous function
/// of x and of the pose, which distances from a whole surface aren't, as long as the patch isn't
/// folded up (FarSides).
class Outside {
 public:
  /// surface: at rest; outlives this. tree: over it. seeds: of each point the nearest one of it.
  Outside(const PosedSurface& surface, const AabbTree& tree,
          const std::vector<PointOnTriangle>& seeds, ThreadPool& pool);

  struct Level {
    double height;  ///< f
    Eigen::Vector3d
        direction;  ///< in which it grows: a unit vector; zero where nothing has an area
  };
  Level at(Index point, const Eigen::Vector3d& place) const;
  /// Quickly: side × f is no less than this, the least of what it is a mean of.
  double least(Index point, const Eigen::Vector3d& place, double side) const;
  /// How much the patch still faces outwards.
  double outwardness(Index point) const;

 private:
  Fans::Range patch(Index point) const {
    return {patches_.data() + begin_[size_t(point)], patches_.data() + begin_[size_t(point) + 1]};
  }
  FarSides::About about(int point) const;

  const PosedSurface& surface_;
  std::vector<int> begin_{0}, patches_;  // of point i: begin_[i] to begin_[i + 1]
  std::vector<double> widths_;           // ε² of each triangle, at rest
  SourcePoints seeds_;
  std::unique_ptr<FarSides> far_sides_;
};

}  // namespace dd
