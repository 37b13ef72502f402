// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mesh/aabb_tree.h"
#include "mesh/correspondence.h"
#include "support/similarity.h"
#include "support/thread_pool.h"

namespace dd {

/// What a target lies over as it stands, as a garment over a body: the nearest point of the source
/// to each of its vertices and to the centre of each of its triangles. One that faces the same way
/// is preferred to a nearer one that doesn't, unless it is much farther: the inside of a sleeve
/// belongs to the arm, not to the chest beside it.
struct NearestPoints {
  /// placement takes the source onto the target.
  NearestPoints(const Mesh& source, const Mesh& target, const Similarity& placement,
                ThreadPool& pool);

  /// Of each triangle those of its corners and its centre.
  Correspondence correspondence(const Mesh& source, const Mesh& target) const;

  std::vector<PointOnTriangle> of_vertices, of_centres;
  double distance = 0;  ///< of the target's vertices, on the mean
};

}  // namespace dd
