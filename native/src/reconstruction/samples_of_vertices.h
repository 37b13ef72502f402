// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <vector>

#include "mesh/aabb_tree.h"
#include "reconstruction/factored_surface.h"
#include "reconstruction/section_rays.h"

namespace dd {

/// The vertices of a surface whose sections are sampled.
struct CrossSectionSamples {
  const FactoredSurface& surface;
  Triangles triangles;         ///< that rays meet, of the surface's vertices
  const FactoredSurface& own;  ///< whose active vertices they are: the surface, or a coarse one
  std::vector<int> vertices;   ///< the same, as vertices of the surface
  /// The sample that stands for an active vertex of the surface.
  std::function<int(int active_index)> sample_of;

  /// Whether each active vertex of the surface is a sample.
  bool are_vertices() const { return &own == &surface; }
};

/// Samples in place of vertices that rays meet.
class SamplesOfVertices {
 public:
  /// Both must outlive this.
  SamplesOfVertices(const CrossSectionSamples& samples, const SectionRays& rays);
  SamplesOfVertices(const SamplesOfVertices&) = delete;  // the tree refers to the rims
  SamplesOfVertices& operator=(const SamplesOfVertices&) = delete;

  /// The sample that stands for a vertex: beyond the rims the nearest rim of its component that
  /// moves as it does, or -1.
  int of(int vertex) const;
  /// The distance to the nearest rim, negative outside the free part. depths: of the samples.
  double depth_of(int vertex, const Eigen::VectorXd& depths) const;
  int corner(const PointOnTriangle& point, Index corner) const {
    return rays_.mesh().triangles(point.triangle, corner);
  }
  int nearest_corner(const PointOnTriangle& point) const;
  bool are_vertices() const { return samples_.are_vertices(); }

 private:
  template <class Accept>
  PointOnTriangle nearest_rim(int vertex, const Accept& accept) const;

  const CrossSectionSamples& samples_;
  const SectionRays& rays_;
  Mesh rims_;
  AabbTree tree_;
};

}  // namespace dd
