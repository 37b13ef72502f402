// SPDX-License-Identifier: GPL-3.0-or-later
#include "reconstruction/cross_sections.h"

#include <algorithm>

#include "reconstruction/free_lengths.h"
#include "reconstruction/samples_of_vertices.h"

namespace dd {

namespace {

// The share from which on a section is whole. Tuned: an arm twisted by three turns keeps .94 of its
// sections; with 1, .87, as a share of .95 at its root lets a tenth of it collapse.
// 126 poses of public meshes have 1,270 new intersecting pairs, with 1 1,348, with .7 1,344.
constexpr double kWhole = 0.85;

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
                               const SamplesOfVertices& samples) {
  CrossSections::Terms terms;
  double rest = 1;
  const auto add = [&](int vertex, double weight) {
    const int sample = samples.of(vertex);
    if (sample < 0 || weight == 0) return;
    terms.emplace_back(sample, 0.5 * weight);
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
  const SectionRays rays(samples.surface, samples.triangles, samples.vertices,
                         free.lengths.maxCoeff());
  const SamplesOfVertices of_vertices(samples, rays);
  auto found = std::make_unique<CrossSections>();
  found->shares.setZero(count);
  found->means.resize(size_t(count));
  SampledSections sampled = sample_sections(samples, rays, of_vertices, free);
  found->axes = std::move(sampled.axes);
  Positions centres = samples.surface.mesh.positions(samples.vertices, kAllIndices);
  constexpr int kLeastSections = 256;
  samples.surface.poisson->pool().parallel_for(
      count, kLeastSections, [&](int64_t begin, int64_t end) {
        for (int64_t i = begin; i < end; ++i) {
          const SectionSample& section = sampled.sections[size_t(i)];
          const double share = std::min(1.0, section.share / kWhole);
          if (share > 0) centres.row(i) += share / section.share * section.to_centre;
          found->shares[i] = share;
          found->means[size_t(i)] = mean_over(section, static_cast<int>(i), of_vertices);
        }
      });
  found->average(centres, count);
  found->arms = samples.surface.mesh.positions(samples.vertices, kAllIndices) - centres;
  return found;
}

std::unique_ptr<CrossSections> find_cross_sections(const FactoredSurface& surface) {
  CrossSectionSamples samples{
      surface, surface.mesh.triangles, surface, {}, [](int active_index) { return active_index; }};
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
