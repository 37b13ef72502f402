// SPDX-License-Identifier: GPL-3.0-or-later
#include "wear/layers.h"

#include <algorithm>

namespace dd {

namespace {

// Least cosine between the arm from the point below and that from the body: leaves out what lies
// beside.
constexpr double kStraight = 0.8;

}  // namespace

Layers::Layers(const Mesh& garment, const Positions& arms, double reach, ThreadPool& pool)
    : triangles_(garment.triangles), of_vertex_(static_cast<size_t>(garment.vertex_count()), -1) {
  const AabbTree tree(garment);
  std::vector<PointOnTriangle> below(of_vertex_.size());
  pool.parallel_for(garment.vertex_count(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (Index v = begin; v < end; ++v) {
      const Eigen::Vector3d place = garment.positions.row(v).transpose(),
                            arm = arms.row(v).transpose();
      const double length = arm.norm();
      if (!(length > 0)) continue;
      below[size_t(v)] = tree.nearest(place, std::min(length, reach), [&](int j) {
        double deepest = 0;
        for (int corner : triangles_.row(j)) {
          if (corner == v) return false;
          deepest = std::max(deepest, (place - garment.positions.row(corner).transpose()).dot(arm));
        }
        if (!(deepest > 0)) return false;
        const Eigen::Vector3d way = place - nearest_on_triangle(garment, j, place).place;
        return way.dot(arm) > kStraight * length * way.norm();
      });
    }
  });
  for (size_t v = 0; v < below.size(); ++v) {
    if (below[v].triangle < 0) continue;
    of_vertex_[v] = count();
    layers_.push_back({static_cast<int>(v), below[v],
                       garment.positions.row(Index(v)).transpose() - below[v].place});
  }
}

Eigen::Vector3d Layers::arm_in(int layer, const Positions& garment) const {
  const Layer& one = layers_[size_t(layer)];
  return (garment.row(one.vertex) - place_of(one.below, garment, triangles_)).transpose();
}

}  // namespace dd
