// SPDX-License-Identifier: GPL-3.0-or-later
#include "wear/probes.h"

#include <cmath>

namespace dd {

namespace {

// Least cosine, up or down, between a vertex' normal and the direction to its closest point on the
// target: leaves out vertices beyond a garment's rim.
constexpr double kMinCosineToNormal = 0.7;

}  // namespace

Probes::Probes(const PosedSurface& surface, const AabbTree& tree, const Mesh& target,
               double max_distance, ThreadPool& pool)
    : surface_(surface),
      target_(target.triangles),
      corner_shift_begin_(static_cast<size_t>(target.vertex_count()) + 1, 0) {
  const AabbTree target_tree(target);
  const Positions& positions = surface.mesh().positions;
  std::vector<PointOnTriangle> nearest_points(static_cast<size_t>(positions.rows()));
  pool.parallel_for(positions.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (int v = static_cast<int>(begin); v < end; ++v) {
      const Eigen::Vector3d position = positions.row(v).transpose();
      PointOnTriangle& nearest = nearest_points[size_t(v)];
      nearest = target_tree.nearest(position, max_distance, [](int) { return true; });
      const double along = surface.patch(surface.fan(v))
                               .normal.normalized()
                               .dot(nearest.position.transpose() - position.transpose());
      if (!(std::abs(along) >= kMinCosineToNormal * std::sqrt(nearest.squared_distance)))
        nearest.triangle = -1;
    }
  });
  for (int v = 0; v < static_cast<int>(positions.rows()); ++v) {
    const PointOnTriangle& nearest = nearest_points[size_t(v)];
    if (nearest.triangle < 0) continue;
    probes_.push_back({v, nearest});
    for (int corner : target_.row(nearest.triangle)) ++corner_shift_begin_[size_t(corner) + 1];
  }
  for (size_t v = 1; v < corner_shift_begin_.size(); ++v)
    corner_shift_begin_[v] += corner_shift_begin_[v - 1];
  corner_shifts_.resize(3 * probes_.size());
  std::vector<int> next(corner_shift_begin_.begin(), corner_shift_begin_.end() - 1);
  for (int i = 0; i < count(); ++i) {
    const Probe& probe = probes_[size_t(i)];
    for (int k = 0; k < 3; ++k)
      corner_shifts_[size_t(next[size_t(target_(probe.over.triangle, k))]++)] = {
          i, probe.over.barycentric[k] / probe.over.barycentric.squaredNorm()};
  }
  directions_.resize(count(), 3);
  update_directions(pool);
  far_sides_ = std::make_unique<FarSides>(
      surface, tree, count(), [this](int i) { return point_patch(i); }, pool);
}

void Probes::update_directions(ThreadPool& pool) {
  pool.parallel_for(count(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (int i = static_cast<int>(begin); i < end; ++i)
      directions_.row(i) = point_patch(i).patch.normal.normalized();
  });
}

double Probes::height(int i, const Positions& target) const {
  const Probe& probe = probes_[size_t(i)];
  return directions_.row(i).dot(position_of(probe.over, target, target_) -
                                surface_.mesh().positions.row(probe.vertex));
}

}  // namespace dd
