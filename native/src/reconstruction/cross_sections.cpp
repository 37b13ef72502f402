// SPDX-License-Identifier: GPL-3.0-or-later
#include "reconstruction/cross_sections.h"

#include <algorithm>
#include <limits>

#include "mesh/aabb_tree.h"
#include "reconstruction/limb_axes.h"
#include "reconstruction/section_rays.h"

namespace dd {

namespace {

/// A mesh of the samples at rims: a triangle each, all of whose corners are the rim's vertex.
Mesh rims_of(const CrossSectionSamples& samples) {
  const auto count = static_cast<Index>(samples.vertices.size()) - samples.free_count;
  Triangles corners(count, 3);
  for (Index i = 0; i < count; ++i)
    corners.row(i).setConstant(samples.vertices[size_t(samples.free_count + i)]);
  return {samples.surface.mesh.positions, corners};
}

/// Samples in place of vertices that rays meet.
class SamplesOfVertices {
 public:
  SamplesOfVertices(const CrossSectionSamples& samples, const SectionRays& rays)
      : samples_(samples), rays_(rays), rims_(rims_of(samples)), tree_(rims_) {}

  /// Appends the terms that stand for a vertex.
  void add(int vertex, double weight, CrossSections::Terms& terms) const {
    const int active = samples_.surface.poisson->active_index_of_vertex(vertex);
    if (active >= 0) return samples_.add_terms(active, weight, terms);
    // Beyond the rims: the nearest rim of its component that moves as it does.
    const std::vector<int>& role = samples_.surface.region.role;
    const PointOnTriangle rim =
        tree_.nearest(rims_.positions.row(vertex).transpose(),
                      std::numeric_limits<double>::infinity(), [&](int i) {
                        const int other = rims_.triangles(i, 0);
                        return role[size_t(other)] == role[size_t(vertex)] &&
                               rays_.component_of(other) == rays_.component_of(vertex);
                      });
    if (rim.triangle >= 0) terms.emplace_back(samples_.free_count + rim.triangle, weight);
  }

 private:
  const CrossSectionSamples& samples_;
  const SectionRays& rays_;
  Mesh rims_;
  AabbTree tree_;
};

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
CrossSections::Terms mean_over(const SectionSample& section, int own,
                               const SamplesOfVertices& samples, const Triangles& triangles) {
  CrossSections::Terms terms;
  for (size_t k = 0; k < kSectionRays; ++k) {
    const PointOnTriangle& point = section.points[k];
    if (point.triangle < 0) continue;
    Index corner = 0;
    point.barycentric.maxCoeff(&corner);
    samples.add(triangles(point.triangle, corner), 0.5 * section.weights[k], terms);
  }
  double rest = 1;
  for (const auto& term : terms) rest -= term.second;
  terms.emplace_back(own, rest);
  merge(terms);
  return terms;
}

}  // namespace

std::unique_ptr<CrossSections> find_cross_sections(const CrossSectionSamples& samples) {
  const SectionRays rays(samples.surface, samples.vertices);
  const auto count = static_cast<Index>(samples.vertices.size());
  const SamplesOfVertices of_vertices(samples, rays);
  const Positions axes = limb_axes(samples.own);
  auto found = std::make_unique<CrossSections>();
  found->shares.resize(count);
  found->means.resize(size_t(count));
  Positions centres(count, 3);
  constexpr int kLeastRays = 64;
  samples.surface.poisson->pool().parallel_for(count, kLeastRays, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      const SectionSample section = rays.from(samples.vertices[size_t(i)], axes.row(i).transpose());
      centres.row(i) = section.centre;
      found->shares[i] = section.share;
      found->means[size_t(i)] =
          mean_over(section, static_cast<int>(i), of_vertices, rays.mesh().triangles);
    }
  });
  for (int round = 0; round < kCrossSectionRounds; ++round) {
    const Positions before = centres;
    for (Index i = 0; i < count; ++i) {
      centres.row(i).setZero();
      for (const auto& [index, weight] : found->means[size_t(i)])
        centres.row(i) += weight * before.row(index);
    }
  }
  found->arms = samples.surface.mesh.positions(samples.vertices, kAllIndices) - centres;
  return found;
}

std::unique_ptr<CrossSections> find_cross_sections(const FactoredSurface& surface) {
  CrossSectionSamples samples{surface,
                              surface,
                              {},
                              surface.order().free_count,
                              [](int active_index, double weight, CrossSections::Terms& terms) {
                                terms.emplace_back(active_index, weight);
                              }};
  for (int i = 0; i < surface.poisson->active_vertex_count(); ++i)
    samples.vertices.push_back(surface.poisson->active_vertex(i));
  return find_cross_sections(samples);
}

double CrossSections::bytes() const {
  size_t terms = 0;
  for (const Terms& of : means) terms += of.capacity();
  return static_cast<double>(terms * sizeof(Terms::value_type) + means.size() * sizeof(Terms)) +
         static_cast<double>((arms.size() + shares.size()) * Index(sizeof(double)));
}

}  // namespace dd
