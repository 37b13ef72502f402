// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mesh/aabb_tree.h"

namespace dd {

/// The largest loose parts of a mesh, numbered by descending area; at most 128.
struct LooseParts {
  explicit LooseParts(const Mesh& mesh);

  int count = 0;
  std::vector<int> of_vertex;  ///< each vertex' part; −1: of a smaller part, or one without area
};

/// Which loose parts of two meshes may correspond: an eye to the other head's eye, teeth to teeth,
/// skin to skin, though an eyeball lies nearer to a lid than the other lid does. The distance of
/// two parts is Wasserstein's distance between the normal distributions with the mean μ and
/// covariance C of each part's area,
///
///   d² = |μ − μ'|² + tr(C + C' − 2 (C^½ C' C^½)^½).
///
/// Two parts may correspond if, for at least one of them, no other part is much nearer. So one part
/// may correspond to each of several that it is split into in the other mesh. Small parts that
/// LooseParts doesn't number may correspond to all. In the assignment of all parts with the least
/// Σ d², parts paired with one of like shape may not correspond to any other such part: in a row of
/// teeth the next one is often nearer.
class PartPairs {
 public:
  /// Both meshes in a common space. All must outlive this.
  PartPairs(const Mesh& mesh, const LooseParts& parts, const Mesh& other,
            const LooseParts& parts_of_other);

  /// The closest point of the other mesh within reach and with a normal less than 90° off. It is on
  /// a part that may correspond if there is such a point within 3% of the box's diagonal, else on
  /// any part. vertex: the point is on the part of this vertex. tree: over the other mesh.
  PointOnTriangle nearest_facing(const AabbTree& tree, int vertex, const Eigen::Vector3d& point,
                                 const Eigen::Vector3d& normal, double reach) const;

 private:
  const Triangles& triangles_;  // of the other mesh
  const std::vector<int>&part_of_vertex_, &part_of_other_vertex_;
  int other_part_count_;  // of the other mesh's parts
  double preferred_distance_;
  std::vector<char>
      may_correspond_;  // row by row, for each part each one of the other mesh; empty: all
};

}  // namespace dd
