// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mesh/aabb_tree.h"
#include "mesh/correspondence.h"
#include "support/thread_pool.h"

namespace dd {

/// For each vertex of a target, the nearest point of a source that was deformed onto it, searched
/// by SurfaceWalk from the triangles that correspond to those around the vertex; triangle -1 where
/// none of them has a source. More exact than the triangle pairs alone, since the source's
/// triangles may be large.
std::vector<PointOnTriangle> points_of_fit(const Mesh& fitted, const Mesh& target,
                                           const Correspondence& correspondence, ThreadPool& pool);

}  // namespace dd
