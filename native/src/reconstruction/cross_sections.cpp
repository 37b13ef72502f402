// SPDX-License-Identifier: GPL-3.0-or-later
#include "reconstruction/cross_sections.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "mesh/aabb_tree.h"
#include "reconstruction/free_lengths.h"
#include "reconstruction/limb_axes.h"
#include "reconstruction/section_rays.h"

namespace dd {

namespace {

// Difference of depths at which half of a section counts, as a fraction of its thickness. Tuned: 36
// poses of public meshes have 124 new intersecting pairs, without it 188.
constexpr double kHalfUnevenness = 0.5;
// The share from which on a section is whole. Tuned: an arm twisted by three turns keeps .94 of its
// sections; with 1, .87, as a share of .95 at its root lets a tenth of it collapse.
// 126 poses of public meshes have 1,270 new intersecting pairs, with 1 1,348, with .7 1,344.
constexpr double kWhole = 0.85;

/// A mesh of the samples at rims: a triangle each, all of whose corners are the rim's vertex.
Mesh rims_of(const CrossSectionSamples& samples) {
  const int free_count = samples.own.order().free_count;
  Triangles corners(static_cast<Index>(samples.vertices.size()) - free_count, 3);
  for (Index i = 0; i < corners.rows(); ++i)
    corners.row(i).setConstant(samples.vertices[size_t(free_count + i)]);
  return {samples.surface.mesh.positions, corners};
}

/// Samples in place of vertices that rays meet.
class SamplesOfVertices {
 public:
  SamplesOfVertices(const CrossSectionSamples& samples, const SectionRays& rays)
      : samples_(samples), rays_(rays), rims_(rims_of(samples)), tree_(rims_) {}

  /// The sample that stands for a vertex: beyond the rims the nearest rim of its component that
  /// moves as it does, or -1.
  int of(int vertex) const {
    const int active = samples_.surface.poisson->active_index_of_vertex(vertex);
    if (active >= 0) return samples_.sample_of(active);
    const std::vector<int>& role = samples_.surface.region.role;
    const PointOnTriangle rim =
        nearest_rim(vertex, [&](int v) { return role[size_t(v)] == role[size_t(vertex)]; });
    return rim.triangle < 0 ? -1 : samples_.own.order().free_count + rim.triangle;
  }
  /// The distance to the nearest rim, negative outside the free part. depths: of the samples.
  double depth_of(int vertex, const Eigen::VectorXd& depths) const {
    const int active = samples_.surface.poisson->active_index_of_vertex(vertex);
    if (active >= 0) return depths[samples_.sample_of(active)];
    return -std::sqrt(nearest_rim(vertex, [](int) { return true; }).squared_distance);
  }
  int nearest_corner(const PointOnTriangle& point) const {
    Index nearest = 0;
    point.barycentric.maxCoeff(&nearest);
    return corner(point, nearest);
  }
  int corner(const PointOnTriangle& point, Index corner) const {
    return rays_.mesh().triangles(point.triangle, corner);
  }
  /// Whether each active vertex of the surface is a sample.
  bool are_vertices() const { return &samples_.own == &samples_.surface; }

 private:
  /// The nearest rim of a vertex' component for which accept(rim's vertex) is true; its triangle is
  /// the rim's number.
  template <class Accept>
  PointOnTriangle nearest_rim(int vertex, const Accept& accept) const {
    return tree_.nearest(rims_.positions.row(vertex).transpose(),
                         std::numeric_limits<double>::infinity(), [&](int i) {
                           const int rim = rims_.triangles(i, 0);
                           return rays_.component_of(rim) == rays_.component_of(vertex) &&
                                  accept(rim);
                         });
  }

  const CrossSectionSamples& samples_;
  const SectionRays& rays_;
  Mesh rims_;
  AabbTree tree_;
};

/// How much of a section is there: 1 where the vertex and the opposite point are as deep within the
/// free part, less where their depths differ by a good part of the thickness, as where only a part
/// of one side of a limb is free.
double evenness(double depth, double opposite_depth, double thickness) {
  const double difference = (std::clamp(depth, -thickness, thickness) -
                             std::clamp(opposite_depth, -thickness, thickness)) /
                            thickness;
  const double ratio = difference / kHalfUnevenness, square = ratio * ratio;
  return 1 / (1 + square * square);
}

/// Adds up the weights of equal indices.
void merge(CrossSections::Terms& terms) {
  std::sort(terms.begin(), terms.end());
  size_t last = 0;
  for (size_t i = 1; i < terms.size(); ++i)
    if (terms[i].first == terms[last].first)
      terms[last].second += terms[i].second;
    else
      terms[++last] = terms[i];
  terms.resize(last + 1);
}

/// The terms of the mean over a section; half of it is the vertex itself.
CrossSections::Terms mean_over(const SectionSample& section, int own, double even,
                               const SamplesOfVertices& samples) {
  CrossSections::Terms terms;
  double rest = 1;
  const auto add = [&](int vertex, double weight) {
    const int sample = samples.of(vertex);
    if (sample < 0 || weight == 0) return;
    terms.emplace_back(sample, 0.5 * even * weight);
    rest -= terms.back().second;
  };
  for (size_t k = 0; k < kSectionRays; ++k) {
    const PointOnTriangle& point = section.points[k];
    if (point.triangle < 0) continue;
    if (!samples.are_vertices()) {
      add(samples.nearest_corner(point), section.weights[k]);
      continue;
    }
    // Interpolated, or the mean would depend on how quads are cut into triangles.
    for (int c = 0; c < 3; ++c)
      add(samples.corner(point, c), section.weights[k] * point.barycentric[c]);
  }
  terms.emplace_back(own, rest);
  merge(terms);
  return terms;
}

}  // namespace

std::unique_ptr<CrossSections> find_cross_sections(const CrossSectionSamples& samples) {
  const auto count = static_cast<Index>(samples.vertices.size());
  const FreeLengths free = free_lengths(samples.own);
  const SectionRays rays(samples.surface, samples.vertices, free.lengths.maxCoeff());
  const SamplesOfVertices of_vertices(samples, rays);
  auto found = std::make_unique<CrossSections>();
  found->shares.setZero(count);
  found->means.resize(size_t(count));
  constexpr int kLeastRays = 64;
  ThreadPool& pool = samples.surface.poisson->pool();
  Eigen::VectorXd thicknesses(count);
  pool.parallel_for(count, kLeastRays, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i)
      thicknesses[i] = rays.thickness(samples.vertices[size_t(i)], free.lengths[i]);
  });
  found->axes = limb_axes(samples.own, thicknesses);
  Positions centres = samples.surface.mesh.positions(samples.vertices, kAllIndices);
  pool.parallel_for(count, kLeastRays, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      const int vertex = samples.vertices[size_t(i)];
      const SectionSample section =
          rays.from(vertex, found->axes.row(i).transpose(), free.lengths[i]);
      double even = 0;
      if (const PointOnTriangle& opposite = section.points[0]; opposite.triangle >= 0)
        even = evenness(free.depths[i],
                        of_vertices.depth_of(of_vertices.nearest_corner(opposite), free.depths),
                        std::sqrt(opposite.squared_distance));
      const double share = std::min(1.0, even * section.share / kWhole);
      if (share > 0) centres.row(i) += share / section.share * section.to_centre;
      found->shares[i] = share;
      found->means[size_t(i)] = mean_over(section, static_cast<int>(i), even, of_vertices);
    }
  });
  found->average(centres, count);
  found->arms = samples.surface.mesh.positions(samples.vertices, kAllIndices) - centres;
  return found;
}

std::unique_ptr<CrossSections> find_cross_sections(const FactoredSurface& surface) {
  CrossSectionSamples samples{surface, surface, {}, [](int active_index) { return active_index; }};
  for (int i = 0; i < surface.poisson->active_vertex_count(); ++i)
    samples.vertices.push_back(surface.poisson->active_vertex(i));
  return find_cross_sections(samples);
}

double CrossSections::bytes() const {
  size_t terms = 0;
  for (const Terms& of : means) terms += of.capacity();
  return static_cast<double>(terms * sizeof(Terms::value_type) + means.size() * sizeof(Terms)) +
         static_cast<double>((arms.size() + axes.size() + shares.size()) * Index(sizeof(double)));
}

}  // namespace dd
