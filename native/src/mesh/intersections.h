// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <utility>
#include <vector>

#include "mesh/mesh.h"

namespace dd {

/// Pairs of triangles that pass through each other, the lower index first, sorted.
///
/// An edge of one must cross the interior of the other: neither touching nor coplanar overlap
/// counts. Triangles that share an edge are left out; for those that share a vertex only the edges
/// opposite to it are tested. In double precision, not exact.
std::vector<std::pair<int, int>> intersecting_pairs(const Mesh& mesh);

/// The same test for two triangles of the mesh.
bool triangles_intersect(const Mesh& mesh, int first, int second);

}  // namespace dd
