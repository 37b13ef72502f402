// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mesh/aabb_tree.h"
#include "mesh/mesh.h"
#include "mesh/topology.h"
#include "systems/region.h"

namespace dd {

/// The triangles with a marked corner. marked: n.
std::vector<int> triangles_with(const std::vector<char>& marked, const Triangles& triangles);

/// Part of a mesh with fewer of its vertices. Constrained ones are all there, and towards them it
/// is as fine as the mesh.
struct CoarseMesh {
  /// part: the mesh, with those of its triangles that matter. spacing: of the free vertices that
  /// are left, in the mesh's units.
  CoarseMesh(const Mesh& part, const Region& region, double spacing);

  Mesh mesh;
  std::vector<int> vertices;   ///< of the given mesh that its own are, ascending
  std::vector<int> of_vertex;  ///< for each of the given mesh's the one it went to, or -1
  std::vector<int> roles;
  int free_count = 0;
};

/// Where a point lies on a mesh: in the triangle around a vertex, or around a neighbour that is
/// nearer, that has it inside, seen along the normal, or misses it the least. No triangle where all
/// these are without area. fans: the mesh's.
PointOnTriangle point_near(const Mesh& mesh, const Fans& fans, const Eigen::RowVector3d& point,
                           int vertex);

}  // namespace dd
