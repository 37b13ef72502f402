// SPDX-License-Identifier: GPL-3.0-or-later
#include "transfer/outside.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <utility>

#include "mesh/topology.h"
#include "mesh/triangles.h"

namespace dd {

namespace {

constexpr int kPatch = 24;          // triangles
constexpr double kWidth = 0.05;     // ε, of the root of a triangle's area
constexpr double kSameSide = -0.2;  // cosine of the angle to the patch's middle: not the other side
constexpr int kPatchRanges = 64;    // that points are shared out in, whatever the threads

/// The triangles about another one, the nearest first.
class Patches {
 public:
  Patches(const Mesh& mesh, const Fans& fans, const Positions& centres, const Positions& normals)
      : mesh_(mesh),
        fans_(fans),
        centres_(centres),
        normals_(normals),
        seen_(static_cast<size_t>(mesh.triangle_count()), 0) {}

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
      for (int v : mesh_.triangles.row(j))
        for (int other : fans_.of(v))
          if (seen_[size_t(other)] != round_ &&
              normals_.row(other).dot(normals_.row(seed.triangle)) >= kSameSide)
            open(other, (centres_.row(other) - seed.place.transpose()).squaredNorm());
    }
  }

 private:
  const Mesh& mesh_;
  const Fans& fans_;
  const Positions &centres_, &normals_;
  std::vector<int> seen_;  // in which round
  int round_ = 0;
  std::vector<std::pair<double, int>> open_;  // a heap
};

}  // namespace

Outside::Outside(const Mesh& surface, const std::vector<PointOnTriangle>& seeds, ThreadPool& pool)
    : posed_(surface) {
  const Fans fans(surface.triangles, surface.vertex_count());
  const Positions normals = triangle_normals(surface.positions, surface.triangles);
  const Eigen::VectorXd areas = triangle_areas(surface.positions, surface.triangles);
  const double least_area = 1e-6 * areas.mean();
  Positions centres(surface.triangle_count(), 3);
  for (Index j = 0; j < centres.rows(); ++j) {
    centres.row(j) = triangle_centre(surface.positions, surface.triangles, j).transpose();
    widths_.push_back(kWidth * kWidth * std::max(areas[j], least_area));
  }
  std::vector<std::vector<int>> of_ranges(kPatchRanges), ends(kPatchRanges);
  pool.run(kPatchRanges, [&](int range) {
    Patches patches(surface, fans, centres, normals);
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
  take(surface.positions, pool);
}

void Outside::take(const Positions& posed, ThreadPool& pool) {
  posed_.positions = posed;
  planes_.resize(posed_.triangle_count(), 4);
  areas_.resize(static_cast<size_t>(posed_.triangle_count()));
  pool.parallel_for(planes_.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (Index j = begin; j < end; ++j) {
      const auto corner = [&](int k) -> Eigen::RowVector3d {
        return posed_.positions.row(posed_.triangles(j, k));
      };
      Eigen::RowVector3d normal = (corner(1) - corner(0)).cross(corner(2) - corner(0));
      const double doubled = normal.norm();
      if (doubled > 0) normal /= doubled;
      planes_.row(j) << normal, -normal.dot(corner(0));
      areas_[size_t(j)] = doubled;
    }
  });
}

double Outside::least(Index point, const Eigen::Vector3d& place, double side) const {
  double least = std::numeric_limits<double>::infinity();
  for (int i = begin_[size_t(point)]; i < begin_[size_t(point) + 1]; ++i) {
    const auto plane = planes_.row(patches_[size_t(i)]);
    least = std::min(least, side * (plane.head<3>().dot(place) + plane[3]));
  }
  return least;
}

Outside::Level Outside::at(Index point, const Eigen::Vector3d& place) const {
  double height = 0, sum = 0;
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();
  for (int i = begin_[size_t(point)]; i < begin_[size_t(point) + 1]; ++i) {
    const int j = patches_[size_t(i)];
    const double near =
        1 / (nearest_on_triangle(posed_, j, place).squared_distance + widths_[size_t(j)]);
    const double weight = areas_[size_t(j)] * near * near;
    const auto plane = planes_.row(j);
    height += weight * (plane.head<3>().dot(place) + plane[3]);
    direction += weight * plane.head<3>().transpose();
    sum += weight;
  }
  if (!(sum > 0)) return {0, Eigen::Vector3d::Zero()};
  const double length = direction.norm();
  if (length > 0) direction /= length;
  return {height / sum, direction};
}

}  // namespace dd
