// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mesh/aabb_tree.h"
#include "mesh/topology.h"
#include "support/thread_pool.h"
#include "transfer/part_pairs.h"

namespace dd {

/// Where vertices of a source that is being fitted are drawn to.
struct FitGoals {
  enum class Found : char { none, border, goal };

  Positions places;          ///< c_i of each vertex, or where it is
  std::vector<Found> found;  ///< border: only beyond the target's, while the vertex is at none

  /// Of each vertex 1 where it is about as near to its goal as most, falling to 0. Where it has
  /// none it is held back, beyond a border by 1. least: of what is far from its goal.
  Eigen::VectorXd nearness(const Positions& now, double least) const;
};

/// Finds goals on a target: nearest points whose normals are less than a right angle off, within
/// reach, on loose parts that may correspond (PartPairs). Keeps references to the target and the
/// pool.
class GoalFinder {
 public:
  GoalFinder(const Mesh& source, const Mesh& target, double reach, ThreadPool& pool);

  /// By each vertex' nearest point. now: the source where it is.
  FitGoals nearest(const Mesh& now) const;

  /// Of that and of what of the target has its nearest point next to the vertex the mean, the
  /// latter weighted by its area beside the vertex' own, at most as much: ends of the target draw
  /// those of the source, which have no reason to go there by what is nearest to them.
  FitGoals both_ways(const Mesh& now) const;

 private:
  /// normals: of the vertices of now.
  FitGoals nearest(const Mesh& now, const Positions& normals) const;

  const Mesh& target_;
  ThreadPool& pool_;
  double reach_;
  AabbTree tree_;
  LooseParts source_parts_, target_parts_;
  Borders source_borders_, target_borders_;
  Positions target_normals_;  // as long as twice the area about the vertex
};

}  // namespace dd
