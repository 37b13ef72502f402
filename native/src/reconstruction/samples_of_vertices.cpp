// SPDX-License-Identifier: GPL-3.0-or-later
#include "reconstruction/samples_of_vertices.h"

#include <cmath>
#include <limits>

namespace dd {

namespace {

/// A mesh of the samples at rims: a triangle each, all of whose corners are the rim's vertex.
Mesh rims_of(const CrossSectionSamples& samples) {
  const int free_count = samples.own.order().free_count;
  Triangles corners(static_cast<Index>(samples.vertices.size()) - free_count, 3);
  for (Index i = 0; i < corners.rows(); ++i)
    corners.row(i).setConstant(samples.vertices[size_t(free_count + i)]);
  return {samples.surface.mesh.positions, corners};
}

}  // namespace

SamplesOfVertices::SamplesOfVertices(const CrossSectionSamples& samples, const SectionRays& rays)
    : samples_(samples), rays_(rays), rims_(rims_of(samples)), tree_(rims_) {}

/// The nearest rim of a vertex' component for which accept(rim's vertex) is true; its triangle is
/// the rim's number.
template <class Accept>
PointOnTriangle SamplesOfVertices::nearest_rim(int vertex, const Accept& accept) const {
  return tree_.nearest(
      rims_.positions.row(vertex).transpose(), std::numeric_limits<double>::infinity(), [&](int i) {
        const int rim = rims_.triangles(i, 0);
        return rays_.component_of(rim) == rays_.component_of(vertex) && accept(rim);
      });
}

int SamplesOfVertices::of(int vertex) const {
  const int active = samples_.surface.poisson->active_index_of_vertex(vertex);
  if (active >= 0) return samples_.sample_of(active);
  const std::vector<int>& role = samples_.surface.region.role;
  const PointOnTriangle rim =
      nearest_rim(vertex, [&](int v) { return role[size_t(v)] == role[size_t(vertex)]; });
  return rim.triangle < 0 ? -1 : samples_.own.order().free_count + rim.triangle;
}

double SamplesOfVertices::depth_of(int vertex, const Eigen::VectorXd& depths) const {
  const int active = samples_.surface.poisson->active_index_of_vertex(vertex);
  if (active >= 0) return depths[samples_.sample_of(active)];
  return -std::sqrt(nearest_rim(vertex, [](int) { return true; }).squared_distance);
}

int SamplesOfVertices::nearest_corner(const PointOnTriangle& point) const {
  Index nearest = 0;
  point.barycentric.maxCoeff(&nearest);
  return corner(point, nearest);
}

}  // namespace dd
