// SPDX-License-Identifier: GPL-3.0-or-later
#include "wear/nearest_points.h"

#include <cmath>
#include <limits>
#include <string>

#include "mesh/triangles.h"
#include "support/error.h"

namespace dd {

namespace {

// Multiple of the distance of the closest point up to which one that faces the same way is
// preferred.
constexpr double kMaxFacingDistanceRatio = 1.5;
constexpr double kAnyDistance = std::numeric_limits<double>::infinity();

}  // namespace

NearestPoints::NearestPoints(const Mesh& source, const Mesh& target, const Similarity& placement,
                             ThreadPool& pool)
    : of_vertices(static_cast<size_t>(target.vertex_count())),
      of_centres(static_cast<size_t>(target.triangle_count())) {
  const AabbTree tree(source);
  const double side = placement.rotation.determinant() < 0 ? -1 : 1;  // a mirror turns normals over
  const auto nearest = [&](const Eigen::Vector3d& position, const Eigen::Vector3d& normal) {
    const Eigen::Vector3d source_position =
        placement.rotation.transpose() * (position - placement.shift) / placement.scale;
    const PointOnTriangle any =
        tree.nearest(source_position, kAnyDistance, [](int) { return true; });
    const Eigen::Vector3d facing = side * placement.rotation.transpose() * normal;
    const double reach = kMaxFacingDistanceRatio * std::sqrt(any.squared_distance);
    const PointOnTriangle facing_point = tree.nearest_facing(source_position, facing, reach);
    return facing_point.triangle >= 0 ? facing_point : any;
  };
  const Positions at_vertices = summed_normals(target.positions, target.triangles);
  const Positions at_centres = triangle_normals(target.positions, target.triangles);
  pool.parallel_for(target.vertex_count(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (Index v = begin; v < end; ++v)
      of_vertices[size_t(v)] =
          nearest(target.positions.row(v).transpose(), at_vertices.row(v).transpose());
  });
  pool.parallel_for(target.triangle_count(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (Index j = begin; j < end; ++j)
      of_centres[size_t(j)] = nearest(triangle_centre(target.positions, target.triangles, j),
                                      at_centres.row(j).transpose());
  });
  for (size_t v = 0; v < of_vertices.size(); ++v)
    if (of_vertices[v].triangle < 0)
      throw Error(Status::argument, {Subject::target_vertex, Index(v)},
                  "is too far from the source to tell what it lies over", Remedy::move_target);
  for (const PointOnTriangle& point : of_vertices)
    distance += placement.scale * std::sqrt(point.squared_distance) / target.vertex_count();
}

Correspondence NearestPoints::correspondence(const Mesh& source, const Mesh& target) const {
  Pairs pairs;
  pairs.reserve(4 * of_centres.size());
  for (int j = 0; j < target.triangle_count(); ++j) {
    pairs.push_back({of_centres[size_t(j)].triangle, j});
    for (int v : target.triangles.row(j)) pairs.push_back({of_vertices[size_t(v)].triangle, j});
  }
  return triangle_correspondence(pairs, source.triangle_count(), target.triangle_count());
}

}  // namespace dd
