// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mesh/aabb_tree.h"
#include "mesh/correspondence.h"
#include "support/similarity.h"
#include "support/thread_pool.h"

namespace dd {

/// The closest points on the source to the vertices and triangle centres of a target that lies over
/// it, as a garment over a body. A point with a normal less than 90° off is preferred to a closer
/// one unless it is much farther: the inside of a sleeve belongs to the arm, not to the chest
/// beside it.
struct NearestPoints {
  /// placement takes the source onto the target.
  NearestPoints(const Mesh& source, const Mesh& target, const Similarity& placement,
                ThreadPool& pool);

  /// Each target triangle has as sources the triangles closest to its corners and its centre.
  Correspondence correspondence(const Mesh& source, const Mesh& target) const;

  std::vector<PointOnTriangle> of_vertices, of_centres;
  double distance = 0;  ///< mean over the target's vertices, in its units
};

}  // namespace dd
