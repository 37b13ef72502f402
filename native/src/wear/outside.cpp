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

constexpr int kPatch = 24;  // most triangles in a patch; more take longer
// ε, as a fraction of the root of a triangle's area at rest. Safety: weights at d = 0 are finite.
constexpr double kWidth = 0.05;
// Least cosine between the normals of a triangle and of the patch's first one: leaves out the other
// side of a thin body.
constexpr double kSameSide = -0.2;
constexpr int kPatchRanges = 64;  // ranges of points, whatever the number of threads

/// The triangles around a given one, connected through vertices, the closest first.
class Patches {
 public:
  Patches(const PosedSurface& surface, const Positions& centres)
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
    for (int count = 0; !open_.empty() && count < kPatch; ++count) {
      const int j = open_.front().second;
      std::pop_heap(open_.begin(), open_.end(), std::greater<>());
      open_.pop_back();
      patches.push_back(j);
      for (int v : surface_.mesh().triangles.row(j))
        for (int other : surface_.fan(v))
          if (seen_[size_t(other)] != round_ &&
              surface_.normal(other).dot(surface_.normal(seed.triangle)) >= kSameSide)
            open(other, (centres_.row(other) - seed.place.transpose()).squaredNorm());
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
  const double least_area = 1e-6 * surface.areas().mean();
  Positions centres(mesh.triangle_count(), 3);
  for (Index j = 0; j < centres.rows(); ++j) {
    centres.row(j) = triangle_centre(mesh.positions, mesh.triangles, j).transpose();
    widths_.push_back(kWidth * kWidth * std::max(surface.areas()[j], least_area) / 2);
  }
  std::vector<std::vector<int>> of_ranges(kPatchRanges), ends(kPatchRanges);
  pool.run(kPatchRanges, [&](int range) {
    Patches patches(surface, centres);
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
      surface, tree, static_cast<int>(seeds.size()), [this](int i) { return about(i); }, pool);
}

FarSides::About Outside::about(int point) const {
  return {seeds_.at(surface_.mesh().positions, point).transpose(), surface_.patch(patch(point))};
}

double Outside::outwardness(Index point) const {
  const int i = static_cast<int>(point);
  return far_sides_->outwardness(i, about(i));
}

double Outside::least(Index point, const Eigen::Vector3d& place, double side) const {
  double least = std::numeric_limits<double>::infinity();
  for (int j : patch(point)) least = std::min(least, side * surface_.height(j, place));
  return least;
}

Outside::Level Outside::at(Index point, const Eigen::Vector3d& place) const {
  double height = 0, sum = 0;
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();
  for (int j : patch(point)) {
    const double near =
        1 / (nearest_on_triangle(surface_.mesh(), j, place).squared_distance + widths_[size_t(j)]);
    const double weight = surface_.areas()[j] * near * near;
    height += weight * surface_.height(j, place);
    direction += weight * surface_.normal(j).transpose();
    sum += weight;
  }
  if (!(sum > 0)) return {0, Eigen::Vector3d::Zero()};
  const double length = direction.norm();
  if (length > 0) direction /= length;
  return {height / sum, direction};
}

}  // namespace dd
