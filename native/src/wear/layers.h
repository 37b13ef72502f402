// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mesh/aabb_tree.h"
#include "support/thread_pool.h"

namespace dd {

/// Layers of a garment, as the two sides of thick cloth, a lining, a lapel: vertices between which
/// and the body another part of the garment lies at rest, which stays below them.
class Layers {
 public:
  /// arms: from the body's point below each vertex of the garment to it. reach: how thick.
  Layers(const Mesh& garment, const Positions& arms, double reach, ThreadPool& pool);

  int count() const { return static_cast<int>(layers_.size()); }
  int vertex(int layer) const { return layers_[size_t(layer)].vertex; }
  /// From what lies below the vertex to it, at rest.
  const Eigen::Vector3d& arm(int layer) const { return layers_[size_t(layer)].arm; }
  /// The same now.
  Eigen::Vector3d arm_in(int layer, const Positions& garment) const;
  /// The number of a vertex, −1 where nothing lies below it.
  int of(int vertex) const { return of_vertex_[size_t(vertex)]; }

 private:
  struct Layer {
    int vertex;
    PointOnTriangle below;
    Eigen::Vector3d arm;
  };
  const Triangles& triangles_;
  std::vector<Layer> layers_;
  std::vector<int> of_vertex_;  // −1: none
};

}  // namespace dd
