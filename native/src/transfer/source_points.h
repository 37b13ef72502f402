// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <utility>
#include <vector>

#include "mesh/aabb_tree.h"
#include "mesh/topology.h"
#include "transfer/source_gradients.h"
#include "transfer/transfer_context.h"

namespace dd {

/// The point of the source that each vertex of a target corresponds to, from the correspondence of
/// the triangles around the vertex. A first guess is the mean centre of these triangles' sources,
/// plus the vertex' offset from their own mean centre. SurfaceWalk takes it to the surface. On
/// meshes of the same topology that correspond one to one, the point is the same vertex.
class SourcePoints {
 public:
  /// fans: of the target. given: more exact points, for each vertex (triangle −1: not given) or
  /// empty; their weights sum to about 1. The context's own points aren't read.
  SourcePoints(const TransferContext& context, const VertexTriangles& fans,
               const std::vector<PointOnTriangle>& given = {});

  /// Takes points that are known already.
  SourcePoints(const Mesh& source, std::vector<PointOnTriangle> points)
      : triangles_(source.triangles), points_(std::move(points)) {}

  /// Whether a vertex has a point: it was given, or one of its triangles has a source.
  bool is_known(int vertex) const { return points_[vertex].triangle >= 0; }
  /// The position of a vertex' point. positions: of the source's vertices.
  Eigen::Vector3d at(const Positions& positions, int vertex) const {
    return position_of(points_[vertex], positions, triangles_).transpose();
  }

 private:
  const Triangles& triangles_;
  std::vector<PointOnTriangle> points_;
};

}  // namespace dd
