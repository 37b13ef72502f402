// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "match/part_pairs.h"
#include "mesh/aabb_tree.h"
#include "mesh/topology.h"
#include "support/thread_pool.h"

namespace dd {

/// The closest points c_i on the target that attract the vertices of a source being fitted.
struct FitGoals {
  /// border: the closest point is on the target's border though the vertex is not on the source's,
  /// so the vertex has no counterpart.
  enum class Found : char { none, border, goal };

  Positions positions;  ///< c_i of each vertex; its own position where found is not goal
  std::vector<Found> found;

  /// The weight of each vertex' attraction, by the robust error of Geman and McClure: 1 at its
  /// goal, 1/4 at the larger of eight times the median distance to a goal and the distance `least`.
  /// A vertex without a closest point gets a small weight that holds it where it is, 1 where no
  /// vertex has one; one whose
  /// closest point is on a border gets 1.
  Eigen::VectorXd robust_weights(const Positions& now, double least) const;
};

/// Finds the closest points on a target: within reach, with a normal less than 90° off, preferably
/// on a component that may correspond (PartPairs). Keeps references to the target and the pool.
class GoalFinder {
 public:
  GoalFinder(const Mesh& source, const Mesh& target, double reach, ThreadPool& pool);

  /// The closest point of each vertex. now: the source as fitted so far.
  FitGoals nearest(const Mesh& now) const;

  /// As nearest(), averaged with the offsets to the target's vertices from their closest points on
  /// triangles around the vertex. These weigh their area over the vertex' own, together at most 1.
  /// So the ends of the target attract those of the source, whose own closest points don't lead
  /// there.
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
  Positions target_normals_;  // of vertices: see summed_normals()
};

}  // namespace dd
