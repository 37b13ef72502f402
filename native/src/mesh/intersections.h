// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <utility>
#include <vector>

#include "mesh/mesh.h"

namespace dd {

/// Pairs of triangles (the lower number first, ascending) that pass through each other.
///
/// An edge of one must cross the inside of the other: touching doesn't count, nor do triangles that
/// overlap in one plane. Neighbours across an edge are left out; those that share one vertex
/// intersect where the edge opposite to it does. In double precision, not exact.
std::vector<std::pair<int, int>> intersecting_pairs(const Mesh& mesh);

/// Whether two triangles of the mesh intersect in this sense.
bool triangles_intersect(const Mesh& mesh, int first, int second);

}  // namespace dd
