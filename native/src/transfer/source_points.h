// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <utility>
#include <vector>

#include "mesh/aabb_tree.h"
#include "mesh/topology.h"
#include "transfer/source_gradients.h"

namespace dd {

/// The point of the source that each vertex of a target corresponds to, as far as the triangles
/// tell: from the mean of the centres of their sources on by as much as the vertex is from the mean
/// of their own, and from there to the nearest point of the surface that is reached over edges.
/// Of meshes of the same topology the same vertices.
class SourcePoints {
 public:
  /// given: points that are known better, for each vertex or none; their weights add up to about 1.
  SourcePoints(const Mesh& source, const Mesh& target, const Fans& fans,
               const SourceGradients& gradients, const Similarity& placement, ThreadPool& pool,
               const std::vector<PointOnTriangle>& given = {});

  /// Points that are known.
  SourcePoints(const Mesh& source, std::vector<PointOnTriangle> points)
      : triangles_(source.triangles), points_(std::move(points)) {}

  /// Whether a vertex has a triangle with a source.
  bool is_known(int vertex) const { return points_[vertex].triangle >= 0; }
  /// Where its point is, at these places of the source's vertices.
  Eigen::Vector3d at(const Positions& places, int vertex) const {
    return place_of(points_[vertex], places, triangles_).transpose();
  }

 private:
  const Triangles& triangles_;
  std::vector<PointOnTriangle> points_;
};

}  // namespace dd
