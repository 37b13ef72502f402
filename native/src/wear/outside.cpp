// SPDX-License-Identifier: GPL-3.0-or-later
#include "wear/outside.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <utility>

#include "mesh/triangles.h"

namespace dd {

namespace {

constexpr int kMaxPatchTriangles = 24;  // most triangles in a patch; more take longer
// ε, as a fraction of the root of a triangle's area at rest. Safety: weights at d = 0 are finite.
constexpr double kWeightWidth = 0.05;
// Least cosine between the normals of a triangle and of the patch's first one: leaves out the other
// side of a thin body.
constexpr double kMinCosineInPatch = -0.2;
constexpr int kPatchRanges = 64;  // ranges of points, whatever the number of threads

/// The triangles around a given one, connected through vertices, the closest first.
class PatchSearch {
 public:
  PatchSearch(const PosedSurface& surface, const Positions& centres)
      : surface_(surface), centres_(centres), seen_(static_cast<size_t>(centres.rows()), 0) {}

  void add(const PointOnTriangle& seed, std::vector<int>& patches) {
    ++round_;
    open_.clear();
    const auto open = [&](int j, double distance) {
      open_.emplace_back(distance, j);
      std::push_heap(open_.begin(), open_.end(), std::greater<>());
      seen_[size_t(j)] = round_;
    };
    open(seed.triangle, 0);
    for (int count = 0; !open_.empty() && count < kMaxPatchTriangles; ++count) {
      const int j = open_.front().second;
      std::pop_heap(open_.begin(), open_.end(), std::greater<>());
      open_.pop_back();
      patches.push_back(j);
      for (int v : surface_.mesh().triangles.row(j))
        for (int other : surface_.fan(v))
          if (seen_[size_t(other)] != round_ &&
              surface_.normal(other).dot(surface_.normal(seed.triangle)) >= kMinCosineInPatch)
            open(other, (centres_.row(other) - seed.position.transpose()).squaredNorm());
    }
  }

 private:
  const PosedSurface& surface_;
  const Positions& centres_;
  std::vector<int> seen_;  // round in which each triangle was seen last
  int round_ = 0;
  std::vector<std::pair<double, int>> open_;  // a heap of squared distances and triangles
};

}  // namespace

Outside::Outside(const PosedSurface& surface, const AabbTree& tree,
                 const std::vector<PointOnTriangle>& seeds, ThreadPool& pool)
    : surface_(surface), seeds_(surface.mesh(), seeds) {
  const Mesh& mesh = surface.mesh();
  // Safety: a triangle without area would have no width, and an infinite weight.
  const double least_area = 1e-6 * surface.doubled_areas().mean();
  Positions centres(mesh.triangle_count(), 3);
  for (Index j = 0; j < centres.rows(); ++j) {
    centres.row(j) = triangle_centre(mesh.positions, mesh.triangles, j).transpose();
    squared_widths_.push_back(kWeightWidth * kWeightWidth *
                              std::max(surface.doubled_areas()[j], least_area) / 2);
  }
  std::vector<std::vector<int>> of_ranges(kPatchRanges), ends(kPatchRanges);
  pool.run(kPatchRanges, [&](int range) {
    PatchSearch patches(surface, centres);
    std::vector<int>& all = of_ranges[size_t(range)];
    const size_t begin = seeds.size() * range / kPatchRanges,
                 end = seeds.size() * (range + 1) / kPatchRanges;
    for (size_t i = begin; i < end; ++i) {
      patches.add(seeds[i], all);
      ends[size_t(range)].push_back(static_cast<int>(all.size()));
    }
  });
  for (int range = 0; range < kPatchRanges; ++range) {
    const int before = begin_.back();
    for (int end : ends[size_t(range)]) begin_.push_back(before + end);
    patches_.insert(patches_.end(), of_ranges[size_t(range)].begin(),
                    of_ranges[size_t(range)].end());
  }
  far_sides_ = std::make_unique<FarSides>(
      surface, tree, static_cast<int>(seeds.size()), [this](int i) { return point_patch(i); },
      pool);
}

FarSides::PointPatch Outside::point_patch(int point) const {
  return {seeds_.at(surface_.mesh().positions, point).transpose(), surface_.patch(patch(point))};
}

double Outside::outwardness(Index point) const {
  const int i = static_cast<int>(point);
  return far_sides_->outwardness(i, point_patch(i));
}

double Outside::lower_bound(Index point, const Eigen::Vector3d& position, double side) const {
  double lower_bound = std::numeric_limits<double>::infinity();
  for (int j : patch(point))
    lower_bound = std::min(lower_bound, side * surface_.height(j, position));
  return lower_bound;
}

Outside::Height Outside::at(Index point, const Eigen::Vector3d& position) const {
  double height = 0, sum = 0;
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();
  for (int j : patch(point)) {
    const double inverse_square =
        1 / (nearest_on_triangle(surface_.mesh(), j, position).squared_distance +
             squared_widths_[size_t(j)]);
    const double weight = surface_.doubled_areas()[j] * inverse_square * inverse_square;
    height += weight * surface_.height(j, position);
    direction += weight * surface_.normal(j).transpose();
    sum += weight;
  }
  if (!(sum > 0)) return {0, Eigen::Vector3d::Zero()};
  const double length = direction.norm();
  if (length > 0) direction /= length;
  return {height / sum, direction};
}

}  // namespace dd
