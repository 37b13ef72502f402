// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <limits>
#include <vector>

#include "mesh/mesh.h"

namespace dd {

/// The distance over the surface of every vertex from the nearest source, infinite where no path of
/// triangles leads. By fast marching (Kimmel, Sethian 1998): exact for straight fronts on flat
/// parts, too long by a few percent and part of an edge around a single vertex, and across obtuse
/// corners. Where the fronts of two sources meet a bound by the straight distance keeps it from
/// being too short. sources: of each vertex. farthest: what lies beyond may be infinite too, which
/// takes less time.
std::vector<double> geodesic_distances(const Mesh& mesh, const std::vector<char>& sources,
                                       double farthest = std::numeric_limits<double>::infinity());

}  // namespace dd
