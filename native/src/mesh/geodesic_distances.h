// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <limits>
#include <vector>

#include "mesh/mesh.h"

namespace dd {

/// Geodesic distance of every vertex to the nearest source, infinite in components without one, by
/// fast marching (Kimmel, Sethian 1998). Exact for straight fronts on flat parts; too long by a few
/// percent and a fraction of an edge around a single source vertex, and across obtuse corners.
/// Where the fronts of two sources meet, the straight-line distance is a lower bound. sources: n,
/// non-zero for sources. farthest: larger distances may be infinite, too, which saves time.
std::vector<double> geodesic_distances(const Mesh& mesh, const std::vector<char>& sources,
                                       double farthest = std::numeric_limits<double>::infinity());

}  // namespace dd
