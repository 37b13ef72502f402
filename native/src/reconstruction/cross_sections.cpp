// SPDX-License-Identifier: GPL-3.0-or-later
#include "reconstruction/cross_sections.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>

#include "mesh/aabb_tree.h"
#include "mesh/topology.h"
#include "mesh/triangles.h"
#include "support/rotations.h"

namespace dd {

namespace {

// Directions of rays, in degrees: from the inward normal, and about it. Tuned: without the steep
// ones sections of an elliptic shape are not averaged out.
struct Direction {
  double tilt, around;
};
constexpr Direction kDirections[] = {{0, 0},   {30, 0},   {30, 90},  {30, 180}, {30, 270},
                                     {60, 45}, {60, 135}, {60, 225}, {60, 315}};
// The first one decides whether there is another side.
constexpr size_t kRays = std::size(kDirections);
// Distance of the other side at which half of it counts, as a fraction of the surface's size.
constexpr double kHalfThickness = 0.5;

struct CrossSection {
  std::array<PointOnTriangle, kRays> points;
  std::array<double, kRays> weights{};  // of the points; all rays together have 1
  Eigen::RowVector3d centre;
  double share = 0;  // sum of weights
};

/// Casts rays among the triangles of a vertex' own part.
class Rays {
 public:
  explicit Rays(const FactoredSurface& surface)
      : mesh_(surface.mesh),
        size_(surface.active_size),
        tree_(mesh_),
        normals_(summed_normals(mesh_.positions, mesh_.triangles)),
        parts_(mesh_.triangles, mesh_.vertex_count()) {
    // A part whose triangles face inwards has a negative volume; an open one, the cone over it.
    Eigen::VectorXd volumes = Eigen::VectorXd::Zero(parts_.count);
    std::vector<int> apex(size_t(parts_.count), -1);
    for (Index j = 0; j < mesh_.triangles.rows(); ++j) {
      const auto corner = mesh_.triangles.row(j);
      const int part = part_of(corner[0]);
      if (apex[size_t(part)] < 0) apex[size_t(part)] = corner[0];
      const auto at = [&](int k) -> Eigen::Vector3d {
        return (mesh_.positions.row(corner[k]) - mesh_.positions.row(apex[size_t(part)]))
            .transpose();
      };
      volumes[part] += at(0).dot(at(1).cross(at(2)));
    }
    for (int part = 0; part < parts_.count; ++part)
      outwards_.push_back(volumes[part] < 0 ? -1.0 : 1.0);
    for (const Direction& direction : kDirections) all_ += std::cos(direction.tilt * kPi / 180);
  }

  int part_of(int v) const { return parts_.of_vertex[size_t(v)]; }

  CrossSection from(int v) const {
    CrossSection section;
    const Eigen::Vector3d p = mesh_.positions.row(v).transpose();
    section.centre = p.transpose();
    const int part = part_of(v);
    const Eigen::Vector3d n = outwards_[size_t(part)] * normals_.row(v).transpose().normalized();
    if (!(n.squaredNorm() > 0.5)) return section;
    const Eigen::Vector3d a = n.unitOrthogonal(), b = n.cross(a);
    for (size_t k = 0; k < kRays; ++k) {
      const double tilt = kDirections[k].tilt * kPi / 180,
                   around = kDirections[k].around * kPi / 180, cosine = std::cos(tilt);
      const Eigen::Vector3d direction =
          -cosine * n + std::sin(tilt) * (std::cos(around) * a + std::sin(around) * b);
      const PointOnTriangle point =
          tree_.first_exit(p, direction, 1e-6 * size_, outwards_[size_t(part)],
                           [&](int j) { return part_of(mesh_.triangles(j, 0)) == part; });
      if (k == 0 && point.triangle < 0) return section;  // relief of a sheet, open below
      if (point.triangle < 0) continue;
      const double distance = (point.position - p).norm();
      section.points[k] = point;
      section.weights[k] = cosine / all_ / (1 + std::pow(distance / (kHalfThickness * size_), 8));
      section.share += section.weights[k];
      // On a circle, the component of a chord towards the centre is cos² of its diameter.
      section.centre +=
          section.weights[k] * 0.5 * distance / (cosine * cosine) * direction.transpose();
    }
    return section;
  }

 private:
  const Mesh& mesh_;
  double size_;
  AabbTree tree_;
  Positions normals_;
  Components parts_;
  std::vector<double> outwards_;  // by part: 1, or −1 where its normals point inwards
  double all_ = 0;
};

/// Samples in place of vertices that rays meet.
class SamplesOfVertices {
 public:
  SamplesOfVertices(const CrossSectionSamples& samples, const Rays& rays)
      : samples_(samples), rays_(rays) {}

  CrossSections::Terms of(int vertex) const {
    const int active = samples_.surface.poisson->active_index_of_vertex(vertex);
    if (active >= 0) return samples_.terms_of(active);
    // Beyond the rims: the nearest rim of its part that moves as it does.
    int best = -1;
    double least = std::numeric_limits<double>::infinity();
    const Positions& p = samples_.surface.mesh.positions;
    const std::vector<int>& role = samples_.surface.region.role;
    for (size_t i = size_t(samples_.free_count); i < samples_.vertices.size(); ++i) {
      const int rim = samples_.vertices[i];
      if (role[size_t(rim)] != role[size_t(vertex)] || rays_.part_of(rim) != rays_.part_of(vertex))
        continue;
      const double distance = (p.row(rim) - p.row(vertex)).squaredNorm();
      if (distance < least) least = distance, best = static_cast<int>(i);
    }
    if (best < 0) return {};
    return {{best, 1.0}};
  }

 private:
  const CrossSectionSamples& samples_;
  const Rays& rays_;
};

/// The terms of the mean of a section.
CrossSections::Terms mean_over(const CrossSection& section, int own,
                               const SamplesOfVertices& samples, const Triangles& triangles) {
  std::map<int, double> weights;
  double sum = 0;
  for (size_t k = 0; k < kRays; ++k) {
    const PointOnTriangle& point = section.points[k];
    if (point.triangle < 0) continue;
    Index corner = 0;
    point.barycentric.maxCoeff(&corner);
    for (const auto& [index, part] : samples.of(triangles(point.triangle, corner))) {
      const double weight = 0.5 * section.weights[k] * part;  // half of the mean is the vertex
      weights[index] += weight;
      sum += weight;
    }
  }
  weights[own] += 1 - sum;
  return {weights.begin(), weights.end()};
}

}  // namespace

std::unique_ptr<CrossSections> find_cross_sections(const CrossSectionSamples& samples) {
  const Mesh& mesh = samples.surface.mesh;
  const Rays rays(samples.surface);
  const auto count = static_cast<Index>(samples.vertices.size());
  const SamplesOfVertices of_vertices(samples, rays);
  auto found = std::make_unique<CrossSections>();
  found->shares.resize(count);
  found->means.resize(size_t(count));
  Positions centres(count, 3);
  constexpr int kLeastRays = 64;
  samples.surface.poisson->pool().parallel_for(count, kLeastRays, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      const CrossSection section = rays.from(samples.vertices[size_t(i)]);
      centres.row(i) = section.centre;
      found->shares[i] = section.share;
      found->means[size_t(i)] =
          mean_over(section, static_cast<int>(i), of_vertices, mesh.triangles);
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
  found->arms = mesh.positions(samples.vertices, kAllIndices) - centres;
  return found;
}

std::unique_ptr<CrossSections> find_cross_sections(const FactoredSurface& surface) {
  CrossSectionSamples samples{surface, {}, surface.order().free_count, [](int active_index) {
                                return CrossSections::Terms{{active_index, 1.0}};
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
