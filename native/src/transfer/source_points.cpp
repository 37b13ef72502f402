// SPDX-License-Identifier: GPL-3.0-or-later
#include "transfer/source_points.h"

#include "mesh/surface_walk.h"
#include "mesh/triangles.h"

namespace dd {

SourcePoints::SourcePoints(const TransferContext& context, const VertexTriangles& fans,
                           const std::vector<PointOnTriangle>& given)
    : triangles_(context.source->triangles),
      points_(static_cast<size_t>(context.target->vertex_count())) {
  const Mesh &source = *context.source, &target = *context.target;
  const SourceGradients& gradients = *context.gradients;
  const Similarity& placement = *context.placement;
  if (given.empty() && gradients.is_one_to_one() &&
      source.triangle_count() == target.triangle_count() && source.triangles == target.triangles) {
    for (int j = 0; j < target.triangle_count(); ++j)
      for (int k = 0; k < 3; ++k) {
        PointOnTriangle& point = points_[size_t(target.triangles(j, k))];
        point.triangle = j;
        point.barycentric = Eigen::Vector3d::Unit(k);
      }
    return;
  }
  const SurfaceWalk walk(source);
  context.pool->parallel_for(target.vertex_count(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (int v = static_cast<int>(begin); v < end; ++v) {
      if (!given.empty() && given[size_t(v)].triangle >= 0) {
        points_[size_t(v)] = given[size_t(v)];
        points_[size_t(v)].barycentric /= given[size_t(v)].barycentric.sum();
        continue;
      }
      Eigen::Vector3d target_centres = Eigen::Vector3d::Zero(), source_centres = target_centres;
      int count = 0, first = -1;
      for (int j : fans.of(v)) {
        if (!gradients.is_matched(j)) continue;
        if (count++ == 0) first = gradients.first_source(j);
        target_centres += triangle_centre(target.positions, target.triangles, j);
        source_centres += gradients.centre_of_sources(source.positions, j);
      }
      if (count == 0) continue;
      const Eigen::Vector3d offset = target.positions.row(v).transpose() - target_centres / count;
      points_[size_t(v)] = walk.to(
          source_centres / count + placement.rotation.transpose() * offset / placement.scale,
          first);
    }
  });
}

}  // namespace dd
