// SPDX-License-Identifier: GPL-3.0-or-later
#include "match/points_of_fit.h"

#include "mesh/surface_walk.h"

namespace dd {

std::vector<PointOnTriangle> points_of_fit(const Mesh& fitted, const Mesh& target,
                                           const Correspondence& correspondence, ThreadPool& pool) {
  const VertexTriangles fans(target.triangles, target.vertex_count());
  const SurfaceWalk walk(fitted);
  std::vector<PointOnTriangle> points(static_cast<size_t>(target.vertex_count()));
  pool.parallel_for(target.vertex_count(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (int v = static_cast<int>(begin); v < end; ++v)
      for (int j : fans.of(v))
        for (int k = correspondence.begin[j]; k < correspondence.begin[j + 1]; ++k) {
          const PointOnTriangle found =
              walk.to(target.positions.row(v).transpose(), correspondence.source[k]);
          PointOnTriangle& nearest = points[size_t(v)];
          if (found.squared_distance < nearest.squared_distance) nearest = found;
        }
  });
  return points;
}

}  // namespace dd
