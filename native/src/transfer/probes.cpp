// SPDX-License-Identifier: GPL-3.0-or-later
#include "transfer/probes.h"

#include <cmath>

#include "mesh/aabb_tree.h"
#include "mesh/triangles.h"

namespace dd {

namespace {

constexpr double kUpright = 0.7;  // cosine: beyond its rim a garment is over nothing

}  // namespace

Probes::Probes(const Mesh& surface, const Mesh& target, double reach, ThreadPool& pool)
    : surface_(surface.triangles),
      target_(target.triangles),
      begin_(static_cast<size_t>(target.vertex_count()) + 1, 0) {
  take(surface.positions);
  const AabbTree tree(target);
  std::vector<PointOnTriangle> over(static_cast<size_t>(surface.vertex_count()));
  pool.parallel_for(surface.vertex_count(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (Index v = begin; v < end; ++v) {
      const Eigen::Vector3d place = surface.positions.row(v).transpose();
      PointOnTriangle& near = over[size_t(v)];
      near = tree.nearest(place, reach, [](int) { return true; });
      const double along = normals_.row(v).dot(near.place.transpose() - place.transpose());
      if (!(std::abs(along) >= kUpright * std::sqrt(near.squared_distance))) near.triangle = -1;
    }
  });
  for (int v = 0; v < surface.vertex_count(); ++v) {
    const PointOnTriangle& near = over[size_t(v)];
    if (near.triangle < 0) continue;
    probes_.push_back({v, near.triangle, near.weights});
    for (int corner : target_.row(near.triangle)) ++begin_[size_t(corner) + 1];
  }
  for (size_t v = 1; v < begin_.size(); ++v) begin_[v] += begin_[v - 1];
  parts_.resize(3 * probes_.size());
  std::vector<int> next(begin_.begin(), begin_.end() - 1);
  for (int i = 0; i < count(); ++i) {
    const Probe& probe = probes_[size_t(i)];
    for (int k = 0; k < 3; ++k)
      parts_[size_t(next[size_t(target_(probe.triangle, k))]++)] = {
          i, probe.weights[k] / probe.weights.squaredNorm()};
  }
}

void Probes::take(const Positions& posed) {
  posed_ = posed;
  normals_ = summed_normals(posed, surface_);
  normals_.rowwise().normalize();
}

double Probes::height(int i, const Positions& target) const {
  const Probe& probe = probes_[size_t(i)];
  Eigen::RowVector3d over = -posed_.row(probe.vertex);
  for (int k = 0; k < 3; ++k) over += probe.weights[k] * target.row(target_(probe.triangle, k));
  return normals_.row(probe.vertex).dot(over);
}

}  // namespace dd
