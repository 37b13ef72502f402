// SPDX-License-Identifier: GPL-3.0-or-later
#include "transfer/source_points.h"

#include "mesh/triangles.h"

namespace dd {

namespace {

/// Walks from one triangle to the next as long as that brings it nearer to a point.
class Walk {
 public:
  explicit Walk(const Mesh& mesh)
      : mesh_(mesh), edges_(mesh.triangles), of_half_edges_(edges_.of_half_edges()) {}

  PointOnTriangle to(const Eigen::Vector3d& point, int from) const {
    PointOnTriangle best = nearest_on_triangle(mesh_, from, point);
    for (bool nearer = true; nearer;) {
      nearer = false;
      const PointOnTriangle here = best;
      for (int k = 0; k < 3; ++k) {
        if (here.weights[(k + 2) % 3] > 1e-9) continue;  // off this edge
        for (const Edges::HalfEdge& side :
             edges_.of(of_half_edges_[3 * size_t(here.triangle) + k])) {
          const PointOnTriangle there = nearest_on_triangle(mesh_, side.triangle(), point);
          if (!(there.squared_distance < best.squared_distance)) continue;
          best = there;
          nearer = true;
        }
      }
    }
    return best;
  }

 private:
  const Mesh& mesh_;
  Edges edges_;
  std::vector<int> of_half_edges_;
};

}  // namespace

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
  const Walk walk(source);
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

std::vector<PointOnTriangle> points_of_fit(const Mesh& fitted, const Mesh& target,
                                           const Correspondence& correspondence, ThreadPool& pool) {
  const Fans fans(target.triangles, target.vertex_count());
  const Walk walk(fitted);
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
