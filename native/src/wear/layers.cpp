// SPDX-License-Identifier: GPL-3.0-or-later
#include "wear/layers.h"

#include <algorithm>

namespace dd {

namespace {

// Least cosine between the arm from the point below and that from the body: leaves out what lies
// beside.
constexpr double kMinCosineToBody = 0.8;

}  // namespace

Layers::Layers(const Mesh& garment, const Positions& body_offsets, double max_distance,
               ThreadPool& pool)
    : triangles_(garment.triangles), of_vertex_(static_cast<size_t>(garment.vertex_count()), -1) {
  const AabbTree tree(garment);
  std::vector<PointOnTriangle> below(of_vertex_.size());
  pool.parallel_for(garment.vertex_count(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (Index v = begin; v < end; ++v) {
      const Eigen::Vector3d position = garment.positions.row(v).transpose(),
                            offset = body_offsets.row(v).transpose();
      const double length = offset.norm();
      if (!(length > 0)) continue;
      below[size_t(v)] = tree.nearest(position, std::min(length, max_distance), [&](int j) {
        double deepest = 0;
        for (int corner : triangles_.row(j)) {
          if (corner == v) return false;
          deepest =
              std::max(deepest, (position - garment.positions.row(corner).transpose()).dot(offset));
        }
        if (!(deepest > 0)) return false;
        const Eigen::Vector3d to_vertex =
            position - nearest_on_triangle(garment, j, position).position;
        return to_vertex.dot(offset) > kMinCosineToBody * length * to_vertex.norm();
      });
    }
  });
  for (size_t v = 0; v < below.size(); ++v) {
    if (below[v].triangle < 0) continue;
    of_vertex_[v] = count();
    layers_.push_back({static_cast<int>(v), below[v],
                       garment.positions.row(Index(v)).transpose() - below[v].position});
  }
}

Eigen::Vector3d Layers::offset_in(int layer, const Positions& garment) const {
  const Layer& this_layer = layers_[size_t(layer)];
  return (garment.row(this_layer.vertex) - position_of(this_layer.below, garment, triangles_))
      .transpose();
}

}  // namespace dd
