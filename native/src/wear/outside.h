// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "transfer/source_points.h"
#include "wear/far_sides.h"

namespace dd {

/// Signed heights of points over a deforming surface, each relative to the patch of the surface
/// that it lay over at rest. With n_k the normals of the patch's triangles, a_k a corner of each,
/// and d_k the distance of the point x from each,
///
///   f(x) = Σ_k w_k n_kᵀ (x − a_k) / Σ_k w_k,    w_k = area_k / (d_k² + ε²)².
///
/// Close to the surface, f is the signed distance from the closest triangle. Unlike the distance
/// from the whole surface, it is continuous in x and in the pose, as long as the patch isn't folded
/// (FarSides).
class Outside {
 public:
  /// surface: at rest; outlives this. tree: over it. seeds: for each point, the closest one on it.
  Outside(const PosedSurface& surface, const AabbTree& tree,
          const std::vector<PointOnTriangle>& seeds, ThreadPool& pool);

  struct Height {
    double height;              ///< f
    Eigen::Vector3d direction;  ///< unit vector in which it grows; zero if the patch has no area
  };
  Height at(Index point, const Eigen::Vector3d& position) const;
  /// A cheap lower bound of side × f: the least height over a plane of the patch.
  double lower_bound(Index point, const Eigen::Vector3d& position, double side) const;
  /// See FarSides::outwardness().
  double outwardness(Index point) const;

 private:
  VertexTriangles::Range patch(Index point) const {
    return {patches_.data() + begin_[size_t(point)], patches_.data() + begin_[size_t(point) + 1]};
  }
  FarSides::PointPatch point_patch(int point) const;

  const PosedSurface& surface_;
  std::vector<int> begin_{0}, patches_;  // patch of point i: begin_[i] to begin_[i + 1]
  std::vector<double> squared_widths_;   // ε² of each triangle, at rest
  SourcePoints seeds_;
  std::unique_ptr<FarSides> far_sides_;
};

}  // namespace dd
