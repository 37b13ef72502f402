// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "mesh/aabb_tree.h"
#include "mesh/mesh.h"
#include "mesh/topology.h"
#include "systems/region.h"

namespace dd {

/// The triangles with a marked corner. marked: n.
std::vector<int> triangles_with(const std::vector<char>& marked, const Triangles& triangles);

/// The mesh's faces with an active vertex, ascending. An active vertex is a corner of a triangle
/// with a free corner. triangles: those that carry gradients.
std::vector<int> active_faces(const Mesh& mesh, const Region& region, const Triangles& triangles);

/// Upper bound of the spacing of a coarse surface as a fraction of √(area of the active triangles).
/// Safety: the coarse surface keeps the shape of the surface however slowly a field varies.
constexpr double kMaxSpacing = 0.01;

constexpr double kUsualGrowth = 0.5;

/// A contraction of a part of a mesh. It keeps the part's constrained vertices, and towards them
/// its density rises to the mesh's.
struct CoarseMesh {
  /// part: all vertices of the mesh, with the triangles to contract. spacing: distance of the free
  /// vertices that are kept, in the mesh's units.
  /// growth: increase of the spacing per distance from the nearest constrained vertex. Lower values
  /// grade the coarse mesh more gently and keep more vertices.
  CoarseMesh(const Mesh& part, const Region& region, double its_spacing,
             double its_growth = kUsualGrowth);

  double spacing = 0, growth = 0;
  /// The sum over the vertices that were merged into each of its own: of masses, the area that a
  /// coarse vertex stands for, with the relief between coarse vertices.
  Eigen::VectorXd sums(const Eigen::VectorXd& of_vertices) const;

  Mesh mesh;
  std::vector<int> vertices;   ///< its vertices in the given mesh, ascending
  std::vector<int> of_vertex;  ///< vertex of the given mesh → own vertex it was merged into, or -1
  std::vector<int> roles;
  int free_count = 0;
};

/// The contraction of the active faces. triangles: as for active_faces().
std::shared_ptr<const CoarseMesh> contract_active(const Mesh& mesh, const Region& region,
                                                  const Triangles& triangles, double spacing,
                                                  double growth = kUsualGrowth);

/// The point of a mesh nearest to a given one, approximately. Searches the triangles around vertex,
/// and around up to two corners nearer to the point. Takes the one that contains the projection of
/// the point or misses it least, with weights clamped to it. triangle is -1 where all of these have
/// no area. fans: the mesh's.
PointOnTriangle point_near(const Mesh& mesh, const VertexTriangles& fans,
                           const Eigen::RowVector3d& point, int vertex);

}  // namespace dd
