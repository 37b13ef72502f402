// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/surface_walk.h"

namespace dd {

namespace {

/// Largest barycentric weight at which a point counts as on the opposite edge. Safety: rounding
/// leaves weights of points on an edge slightly above 0.
constexpr double kOnEdge = 1e-9;

}  // namespace

SurfaceWalk::SurfaceWalk(const Mesh& mesh)
    : mesh_(mesh), edges_(mesh.triangles), of_half_edges_(edges_.of_half_edges()) {}

PointOnTriangle SurfaceWalk::to(const Eigen::Vector3d& point, int from) const {
  PointOnTriangle best = nearest_on_triangle(mesh_, from, point);
  for (bool nearer = true; nearer;) {
    nearer = false;
    const PointOnTriangle here = best;
    for (int k = 0; k < 3; ++k) {
      if (here.barycentric[(k + 2) % 3] > kOnEdge) continue;
      for (const Edges::HalfEdge& side : edges_.of(of_half_edges_[3 * size_t(here.triangle) + k])) {
        const PointOnTriangle there = nearest_on_triangle(mesh_, side.triangle(), point);
        if (!(there.squared_distance < best.squared_distance)) continue;
        best = there;
        nearer = true;
      }
    }
  }
  return best;
}

}  // namespace dd
