// SPDX-License-Identifier: GPL-3.0-or-later
#include "wear/probes.h"

#include <cmath>

namespace dd {

namespace {

// Least cosine, up or down, between a vertex' normal and the way to its closest point: vertices
// beyond the garment's rim aren't probes.
constexpr double kUpright = 0.7;

}  // namespace

Probes::Probes(const PosedSurface& surface, const AabbTree& tree, const Mesh& target, double reach,
               ThreadPool& pool)
    : surface_(surface),
      target_(target.triangles),
      begin_(static_cast<size_t>(target.vertex_count()) + 1, 0) {
  const AabbTree over_tree(target);
  const Positions& places = surface.mesh().positions;
  std::vector<PointOnTriangle> over(static_cast<size_t>(places.rows()));
  pool.parallel_for(places.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (int v = static_cast<int>(begin); v < end; ++v) {
      const Eigen::Vector3d place = places.row(v).transpose();
      PointOnTriangle& near = over[size_t(v)];
      near = over_tree.nearest(place, reach, [](int) { return true; });
      const double along = surface.patch(surface.fan(v))
                               .normal.normalized()
                               .dot(near.place.transpose() - place.transpose());
      if (!(std::abs(along) >= kUpright * std::sqrt(near.squared_distance))) near.triangle = -1;
    }
  });
  for (int v = 0; v < static_cast<int>(places.rows()); ++v) {
    const PointOnTriangle& near = over[size_t(v)];
    if (near.triangle < 0) continue;
    probes_.push_back({v, near});
    for (int corner : target_.row(near.triangle)) ++begin_[size_t(corner) + 1];
  }
  for (size_t v = 1; v < begin_.size(); ++v) begin_[v] += begin_[v - 1];
  parts_.resize(3 * probes_.size());
  std::vector<int> next(begin_.begin(), begin_.end() - 1);
  for (int i = 0; i < count(); ++i) {
    const Probe& probe = probes_[size_t(i)];
    for (int k = 0; k < 3; ++k)
      parts_[size_t(next[size_t(target_(probe.over.triangle, k))]++)] = {
          i, probe.over.weights[k] / probe.over.weights.squaredNorm()};
  }
  directions_.resize(count(), 3);
  look(pool);
  far_sides_ =
      std::make_unique<FarSides>(surface, tree, count(), [this](int i) { return about(i); }, pool);
}

void Probes::look(ThreadPool& pool) {
  pool.parallel_for(count(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (int i = static_cast<int>(begin); i < end; ++i)
      directions_.row(i) = about(i).patch.normal.normalized();
  });
}

double Probes::height(int i, const Positions& target) const {
  const Probe& probe = probes_[size_t(i)];
  return directions_.row(i).dot(place_of(probe.over, target, target_) -
                                surface_.mesh().positions.row(probe.vertex));
}

}  // namespace dd
