// SPDX-License-Identifier: GPL-3.0-or-later
#include "reconstruction/sampled_sections.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "mesh/topology.h"
#include "reconstruction/limb_axes.h"

namespace dd {

namespace {

// Difference of depths at which half of a section counts, as a fraction of its thickness. Tuned: 36
// poses of public meshes have 124 new intersecting pairs, without it 188.
constexpr double kHalfUnevenness = 0.5;

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

/// The samples from which rays are cast, and those of them beside each other sample.
class Casters {
 public:
  explicit Casters(const CrossSectionSamples& samples)
      : own_(samples.own), fans_(own_.mesh.triangles, own_.mesh.vertex_count()) {
    casts_.assign(samples.vertices.size(), 1);
    if (samples.are_vertices()) return;
    for (size_t i = 0; i < casts_.size(); ++i)
      each_beside(static_cast<int>(i), [&](int other) {
        if (size_t(other) < i) casts_[i] = 0;
      });
  }

  bool casts(int64_t sample) const { return casts_[size_t(sample)] != 0; }
  /// visit(caster), once for each face that it has in common with the sample.
  template <class Visit>
  void each_beside(int sample, const Visit& visit) const {
    const int vertex = own_.poisson->active_vertex(sample);
    for (const int j : fans_.of(vertex))
      for (const int v : own_.mesh.triangles.row(j)) {
        const int other = own_.poisson->active_index_of_vertex(v);
        if (v != vertex && other >= 0 && casts_[size_t(other)]) visit(other);
      }
  }

 private:
  const FactoredSurface& own_;
  VertexTriangles fans_;
  std::vector<char> casts_;
};

/// The section at a sample between casters. sections: theirs. positions: of the samples.
SectionSample between(const Casters& casters, const std::vector<SectionSample>& sections,
                      const Positions& positions, int sample, const Eigen::RowVector3d& axis) {
  const SectionSample* nearest = nullptr;
  double least = 0, share = 0, sum = 0;
  Eigen::RowVector3d to_centre = Eigen::RowVector3d::Zero();
  casters.each_beside(sample, [&](int other) {
    const SectionSample& there = sections[size_t(other)];
    const Eigen::RowVector3d step = positions.row(other) - positions.row(sample);
    // Safety: vertices may coincide. The surface is in a box of about unit size.
    const double weight = 1 / std::max(step.squaredNorm(), 1e-30);
    // To the point of the centre line beside this sample.
    to_centre += weight * (there.to_centre + there.share * (step - step.dot(axis) * axis));
    share += weight * there.share;
    sum += weight;
    if (there.share > 0 && weight > least) {
      least = weight;
      nearest = &there;
    }
  });
  SectionSample section;
  section.to_centre.setZero();
  if (!nearest) return section;
  section = *nearest;
  section *= share / sum / nearest->share;
  section.to_centre = to_centre / sum;
  return section;
}

}  // namespace

SampledSections sample_sections(const CrossSectionSamples& samples, const SectionRays& rays,
                                const SamplesOfVertices& of_vertices, const FreeLengths& free) {
  const auto count = static_cast<Index>(samples.vertices.size());
  const Casters casters(samples);
  const auto for_samples = [&](bool that_cast, const auto& run) {
    constexpr int kLeastRays = 64;
    samples.surface.poisson->pool().parallel_for(count, kLeastRays,
                                                 [&](int64_t begin, int64_t end) {
                                                   for (int64_t i = begin; i < end; ++i)
                                                     if (casters.casts(i) == that_cast)
                                                       run(static_cast<int>(i));
                                                 });
  };
  Eigen::VectorXd thicknesses(count);
  for_samples(true, [&](int i) {
    thicknesses[i] = rays.thickness(samples.vertices[size_t(i)], free.lengths[i]);
  });
  for_samples(false, [&](int i) {
    double sum = 0, number = 0;
    casters.each_beside(i, [&](int other) {
      sum += thicknesses[other];
      number += 1;
    });
    thicknesses[i] = sum / number;
  });
  SampledSections found{limb_axes(samples.own, thicknesses), {}};
  found.sections.resize(size_t(count));
  for_samples(true, [&](int i) {
    SectionSample& section = found.sections[size_t(i)];
    section =
        rays.from(samples.vertices[size_t(i)], found.axes.row(i).transpose(), free.lengths[i]);
    const PointOnTriangle& opposite = section.points[0];
    if (opposite.triangle < 0) return;
    const int across = of_vertices.nearest_corner(opposite);
    section *= evenness(free.depths[i], of_vertices.depth_of(across, free.depths),
                        std::sqrt(opposite.squared_distance));
  });
  const Positions positions = samples.surface.mesh.positions(samples.vertices, kAllIndices);
  for_samples(false, [&](int i) {
    found.sections[size_t(i)] = between(casters, found.sections, positions, i, found.axes.row(i));
  });
  return found;
}

}  // namespace dd
