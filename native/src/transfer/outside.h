// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mesh/aabb_tree.h"
#include "support/thread_pool.h"

namespace dd {

/// How far points are outside of a surface that deforms, by the patch of it that each lay over at
/// rest: with n_k the normals of the patch's triangles, a_k their corners and d_k the distance from
/// the point x to them,
///
///   f(x) = Σ_k w_k n_kᵀ (x − a_k) / Σ_k w_k,    w_k = area_k / (d_k² + ε²)²,
///
/// next to the surface the distance from its nearest triangle, and everywhere a continuous function
/// of x and of the pose, which distances from a whole surface aren't.
class Outside {
 public:
  /// seeds: of each point the nearest point of the surface at rest.
  Outside(const Mesh& surface, const std::vector<PointOnTriangle>& seeds, ThreadPool& pool);

  /// Takes the surface's positions in a pose.
  void take(const Positions& posed, ThreadPool& pool);

  struct Level {
    double height;  ///< f
    Eigen::Vector3d
        direction;  ///< in which it grows: a unit vector; zero where nothing has an area
  };
  Level at(Index point, const Eigen::Vector3d& place) const;
  /// Quickly: side × f is no less than this, the least of what it is a mean of.
  double least(Index point, const Eigen::Vector3d& place, double side) const;

 private:
  Mesh posed_;
  std::vector<int> begin_{0}, patches_;  // of point i: begin_[i] to begin_[i + 1]
  Rows planes_;                 // in the pose: n, and −nᵀ a; zero where there is no area
  std::vector<double> areas_;   // in the pose, doubled
  std::vector<double> widths_;  // ε² of each triangle, at rest
};

}  // namespace dd
