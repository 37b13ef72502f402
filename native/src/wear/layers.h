// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mesh/aabb_tree.h"
#include "support/thread_pool.h"

namespace dd {

/// Layers of a garment, such as the two sides of thick cloth, a lining or a lapel: vertices that at
/// rest have another part of the garment between them and the body. It stays below them.
class Layers {
 public:
  /// body_offsets: for each vertex of the garment, the vector to it from its point on the body;
  /// zero leaves it out. max_distance: the largest distance between layers.
  Layers(const Mesh& garment, const Positions& body_offsets, double max_distance, ThreadPool& pool);

  int count() const { return static_cast<int>(layers_.size()); }
  int vertex(int layer) const { return layers_[size_t(layer)].vertex; }
  /// The vector to the vertex from the point of the garment below it, at rest.
  const Eigen::Vector3d& offset(int layer) const { return layers_[size_t(layer)].offset; }
  /// The same with the garment's vertices at the given positions.
  Eigen::Vector3d offset_in(int layer, const Positions& garment) const;
  /// The index of a vertex' layer; −1: nothing lies below it.
  int of(int vertex) const { return of_vertex_[size_t(vertex)]; }

 private:
  struct Layer {
    int vertex;
    PointOnTriangle below;
    Eigen::Vector3d offset;
  };
  const Triangles& triangles_;
  std::vector<Layer> layers_;
  std::vector<int> of_vertex_;  // −1: none
};

}  // namespace dd
