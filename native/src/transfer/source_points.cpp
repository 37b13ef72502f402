// SPDX-License-Identifier: GPL-3.0-or-later
#include "transfer/source_points.h"

#include "mesh/surface_walk.h"
#include "mesh/triangles.h"

namespace dd {

SourcePoints::SourcePoints(const Mesh& source, const Mesh& target, const Fans& fans,
                           const SourceGradients& gradients, const Similarity& placement,
                           ThreadPool& pool, const std::vector<PointOnTriangle>& given)
    : triangles_(source.triangles), points_(static_cast<size_t>(target.vertex_count())) {
  if (given.empty() && gradients.is_one_to_one() &&
      source.triangle_count() == target.triangle_count() && source.triangles == target.triangles) {
    for (int j = 0; j < target.triangle_count(); ++j)
      for (int k = 0; k < 3; ++k) {
        PointOnTriangle& point = points_[size_t(target.triangles(j, k))];
        point.triangle = j;
        point.weights = Eigen::Vector3d::Unit(k);
      }
    return;
  }
  const SurfaceWalk walk(source);
  pool.parallel_for(target.vertex_count(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (int v = static_cast<int>(begin); v < end; ++v) {
      if (!given.empty() && given[size_t(v)].triangle >= 0) {
        points_[size_t(v)] = given[size_t(v)];
        points_[size_t(v)].weights /= given[size_t(v)].weights.sum();
        continue;
      }
      Eigen::Vector3d own = Eigen::Vector3d::Zero(), of_sources = own;
      int count = 0, first = -1;
      for (int j : fans.of(v)) {
        if (!gradients.is_matched(j)) continue;
        if (count++ == 0) first = gradients.first_source(j);
        own += triangle_centre(target.positions, target.triangles, j);
        of_sources += gradients.centre_of_sources(source.positions, j);
      }
      if (count == 0) continue;
      const Eigen::Vector3d arm = target.positions.row(v).transpose() - own / count;
      points_[size_t(v)] = walk.to(
          of_sources / count + placement.rotation.transpose() * arm / placement.scale, first);
    }
  });
}

}  // namespace dd
