// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <vector>

#include "mesh/aabb_tree.h"
#include "mesh/mesh.h"

namespace dd {

/// The largest part of a mesh by area, or all of one that is in many parts, with a few thousand
/// vertices, in a box of size 1: what an alignment looks at.
struct CoarseShape {
  explicit CoarseShape(const Mesh& mesh);
  CoarseShape(const CoarseShape&) = delete;  // the tree knows its mesh
  CoarseShape& operator=(const CoarseShape&) = delete;

  Mesh mesh;
  std::vector<int> vertices;   ///< of the given mesh that its own are
  std::vector<int> of_vertex;  ///< for each of the given mesh's vertices the one that stands for it
  Positions triangle_normals;
  Positions normals;         ///< of its vertices, summed
  Eigen::VectorXd areas;     ///< of its triangles
  std::vector<int> samples;  ///< vertices that lie apart, the first ones furthest
  AabbTree tree;
  bool connected;  ///< else its functions mean nothing

 private:
  struct Part;
  explicit CoarseShape(Part&& part);
};

/// Vertices that lie apart: each is the furthest from those before, the first from the centre.
std::vector<int> farthest_points(const Positions& positions, int count);

/// The first count of some rows.
template <class Rows>
Rows rows_of(const Rows& all, const std::vector<int>& numbers, size_t count) {
  Rows rows(static_cast<Index>(std::min(count, numbers.size())), all.cols());
  for (Index i = 0; i < rows.rows(); ++i) rows.row(i) = all.row(numbers[size_t(i)]);
  return rows;
}

}  // namespace dd
