// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <vector>

#include "mesh/aabb_tree.h"
#include "mesh/topology.h"
#include "reconstruction/factored_surface.h"

namespace dd {

/// Rays from a vertex into the inside, within the plane of its cross-section.
constexpr int kSectionRays = 3;
/// Their length, as a multiple of the free length. Farther sides, of which less than 1e-3 would
/// count, are not looked for.
constexpr double kSectionReach = 1.2;

/// What the rays from one vertex meet.
struct SectionSample {
  std::array<PointOnTriangle, kSectionRays> points;  ///< triangle: of SectionRays::mesh(), or -1
  std::array<double, kSectionRays> weights{};        ///< of the points
  double share = 0;                                  ///< sum of the weights, in [0, 1]
  Eigen::RowVector3d to_centre;  ///< of the section, as on a circle, times the share

  /// All of it counts by a factor.
  SectionSample& operator*=(double factor) {
    for (double& weight : weights) weight *= factor;
    share *= factor;
    to_centre *= factor;
    return *this;
  }
};

/// Casts rays among the triangles of each vertex' own component.
class SectionRays {
 public:
  /// triangles: those that rays meet, of the surface's vertices. vertices: those from which rays
  /// will be cast, corners of them. longest: the largest of their free lengths.
  SectionRays(const FactoredSurface& surface, const Triangles& triangles,
              const std::vector<int>& vertices, double longest);
  SectionRays(const SectionRays&) = delete;  // the tree refers to the mesh
  SectionRays& operator=(const SectionRays&) = delete;

  /// The distance of the opposite side along the normal; 0: there is none near the free length.
  double thickness(int vertex, double free_length) const;
  /// axis: along the limb. free_length: the section counts as far as it is thin beside that.
  SectionSample from(int vertex, const Eigen::Vector3d& axis, double free_length) const;
  int component_of(int vertex) const { return components_.of_vertex[size_t(vertex)]; }
  /// The triangles that rays can reach.
  const Mesh& mesh() const { return near_; }

 private:
  /// 1, or -1 where the normals of the vertex' component point inwards.
  double outwards_at(int vertex) const { return outwards_[size_t(component_of(vertex))]; }
  PointOnTriangle exit(int vertex, const Eigen::Vector3d& direction, double free_length) const;
  /// The angle to the inward normal at which a ray leaves through the vertex' own triangles on a
  /// side of it, at most 90°.
  double angle_inside(int vertex, const Eigen::Vector3d& normal, const Eigen::Vector3d& side) const;

  double beyond_;  // least distance of a side
  Mesh near_;
  VertexTriangles fans_;
  AabbTree tree_;
  Positions normals_;             // of vertices, not normalized
  Components components_;         // of the surface
  std::vector<double> outwards_;  // by component
};

}  // namespace dd
