// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mesh/mesh.h"

namespace dd {

/// A coarser mesh by merging vertices into their neighbours. Its triangles are those of the given
/// mesh whose corners were merged into three different vertices, so its connectivity is that of the
/// given mesh.
struct Contraction {
  std::vector<int> vertices;   ///< vertices of the given mesh that are left, ascending
  std::vector<int> of_vertex;  ///< n: index in vertices of the one it was merged into; -1: no face
  Triangles triangles;         ///< by indices in vertices
};

/// radii[v]: vertices within this distance along edges may be merged into v; 0 excludes v from
/// merging altogether. Where the surface is too narrow for its radii, as on a wire, nothing is
/// merged: around each vertex that others were merged into, and around its neighbours, the
/// remaining triangles form one fan, closed in the interior. The result depends on positions and
/// not on the numbering of vertices, except for ties.
Contraction contract(const Mesh& mesh, const std::vector<double>& radii);

}  // namespace dd
