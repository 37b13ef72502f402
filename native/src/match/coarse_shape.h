// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <vector>

#include "mesh/aabb_tree.h"
#include "mesh/mesh.h"

namespace dd {

/// A mesh coarsened to a few thousand vertices for alignment, in a box of diagonal 1: its largest
/// component by area, or the whole mesh if that component has less than half of the area.
struct CoarseShape {
  explicit CoarseShape(const Mesh& mesh);
  CoarseShape(const CoarseShape&) = delete;  // the tree refers to the mesh
  CoarseShape& operator=(const CoarseShape&) = delete;

  Mesh mesh;
  std::vector<int> vertices;  ///< for each coarse vertex, the given mesh's vertex that it is
  /// For each vertex of the given mesh, the coarse vertex that it was merged into or, in another
  /// component, that is close to it; -1: none.
  std::vector<int> of_vertex;
  Positions triangle_normals;
  Positions normals;         ///< of its vertices: see summed_normals()
  Eigen::VectorXd areas;     ///< of its triangles
  std::vector<int> samples;  ///< vertices: see farthest_points()
  AabbTree tree;
  bool connected;  ///< else its eigenfunctions are of no use for a map

 private:
  struct ContractedPart;
  explicit CoarseShape(ContractedPart&& part);
};

/// Farthest point sampling: up to count indices, each of the point farthest from those before it,
/// the first of the point farthest from the mean.
std::vector<int> farthest_points(const Positions& positions, int count);

/// The rows with the first count of the given numbers.
template <class Rows>
Rows rows_of(const Rows& all, const std::vector<int>& indices, size_t count) {
  Rows rows(static_cast<Index>(std::min(count, indices.size())), all.cols());
  for (Index i = 0; i < rows.rows(); ++i) rows.row(i) = all.row(indices[size_t(i)]);
  return rows;
}

}  // namespace dd
