// SPDX-License-Identifier: GPL-3.0-or-later
#include "surface/coarse_surface.h"

#include <Eigen/Dense>
#include <algorithm>
#include <utility>

#include "mesh/contraction.h"
#include "mesh/geodesic_distances.h"
#include "mesh/topology.h"

namespace dd {

namespace {

constexpr double kMostLeft = 0.6;  // of the free vertices: beyond, it isn't worth it
constexpr double kGrowth = 0.5;    // of radii with the distance from what is constrained

/// The faces that a coarse surface is made of: with a corner among the active vertices.
Mesh active_part(const FactoredSurface& fine) {
  std::vector<char> active(static_cast<size_t>(fine.mesh.vertex_count()), 0);
  for (int i = 0; i < fine.poisson->active_vertex_count(); ++i)
    active[fine.poisson->active_vertex(i)] = 1;
  std::vector<int> faces;
  for (int j = 0; j < fine.mesh.triangle_count(); ++j)
    for (int k = 0; k < 3; ++k)
      if (active[fine.mesh.triangles(j, k)]) {
        faces.push_back(j);
        break;
      }
  return {fine.mesh.positions, fine.mesh.triangles(faces, Eigen::all)};
}

/// Weights of a point in a triangle, seen along its normal.
Eigen::Vector3d weights_in(const Positions& p, const Triangles& t, int j,
                           const Eigen::RowVector3d& point) {
  const Eigen::RowVector3d a = p.row(t(j, 0)), u = p.row(t(j, 1)) - a, v = p.row(t(j, 2)) - a,
                           x = point - a;
  const double uu = u.dot(u), uv = u.dot(v), vv = v.dot(v), det = uu * vv - uv * uv;
  if (!(det > 1e-12 * uu * vv)) return {-1e9, -1e9, -1e9};
  const double s = (vv * x.dot(u) - uv * x.dot(v)) / det, r = (uu * x.dot(v) - uv * x.dot(u)) / det;
  return {1 - s - r, s, r};
}

/// The triangle around a vertex, or a neighbour that is nearer, which has the point inside or
/// misses it the least; weights in it, none below 0.
void find_triangle(const Positions& p, const Triangles& t, const Fans& fans,
                   const Eigen::RowVector3d& point, int from, Eigen::Vector3i& corners,
                   Eigen::Vector3d& weights) {
  constexpr int kSteps = 3;
  int best = -1;
  Eigen::Vector3d found(0, 0, 0);
  double least = -1e8;
  for (int step = 0; step < kSteps; ++step) {
    const double before = least;
    for (int j : fans.of(from)) {
      const Eigen::Vector3d w = weights_in(p, t, j, point);
      if (w.minCoeff() <= least) continue;
      least = w.minCoeff();
      found = w;
      best = j;
    }
    if (least >= 0 || least == before) break;
    int corner = 0;
    found.maxCoeff(&corner);
    if (t(best, corner) == from) break;
    from = t(best, corner);
  }
  if (best < 0) return;
  corners = t.row(best);
  weights = found.cwiseMax(0);
}

}  // namespace

std::unique_ptr<CoarseSurface> CoarseSurface::make(const FactoredSurface& fine, double spacing) {
  const Region& region = fine.region;
  const Mesh part = active_part(fine);
  const int n = part.vertex_count();
  std::vector<char> constrained(static_cast<size_t>(n), 0);
  for (int v : part.triangles.reshaped()) constrained[v] = region.role[v] != kFree;
  const std::vector<double> distance = geodesic_distances(part, constrained, spacing / kGrowth);
  std::vector<double> radii(static_cast<size_t>(n), 0);
  for (int v : region.free) radii[v] = std::min(spacing, kGrowth * distance[v]);
  // Triangles at rims stay as they are.
  for (int j = 0; j < part.triangle_count(); ++j)
    for (int k = 0; k < 3; ++k)
      if (constrained[part.triangles(j, k)])
        for (int other = 0; other < 3; ++other) radii[part.triangles(j, other)] = 0;
  Contraction made = contract(part, radii);

  std::vector<int> roles;
  int free_count = 0;
  for (int v : made.vertices) {
    roles.push_back(region.role[v]);
    free_count += roles.back() == kFree;
  }
  if (free_count > kMostLeft * region.free_count()) return nullptr;

  std::unique_ptr<CoarseSurface> coarse(new CoarseSurface);
  coarse->region_ = region_of(std::move(roles), region.handle_count);
  for (int v : region.grounds) coarse->region_.grounds.push_back(made.of_vertex[v]);
  Mesh mesh{part.positions(made.vertices, Eigen::all), std::move(made.triangles)};
  coarse->surface_ =
      std::make_unique<FactoredSurface>(std::move(mesh), coarse->region_, Triangulation::delaunay);
  BlockOptions options;
  options.pool = &fine.poisson->pool();
  options.precision = fine.poisson->precision();
  FactoredSurface& surface = *coarse->surface_;
  try {
    surface.factor(free_block(surface.operators.laplacian, coarse->region_), options);
  } catch (const UnsolvableSurface&) {
    return nullptr;  // no fault of the fine surface's, whose vertices it doesn't name
  }
  coarse->vertex_ = std::move(made.vertices);
  coarse->of_vertex_ = std::move(made.of_vertex);
  for (int v : surface.order().vertex_of_row)
    coarse->fine_row_.push_back(fine.order().row_of_vertex[coarse->vertex_[v]]);
  return coarse;
}

void CoarseSurface::restrict(const Rows& fine, Rows& coarse) const {
  coarse.resize(static_cast<Index>(fine_row_.size()), 4);
  for (size_t r = 0; r < fine_row_.size(); ++r)
    coarse.row(static_cast<Index>(r)) = fine.row(fine_row_[r]);
}

std::vector<CoarseSurface::Share> CoarseSurface::shares(const FactoredSurface& fine) const {
  const Positions& p = surface_->mesh.positions;
  const Triangles& t = surface_->mesh.triangles;
  const Fans fans(t, surface_->mesh.vertex_count());
  // -1: of a constrained vertex that no active triangle has.
  const auto place = [&](int vertex) {
    const int row = surface_->order().row_of_vertex[vertex];
    const std::vector<int>& rims = surface_->poisson->rims();
    const bool active =
        row < surface_->order().free_count || std::binary_search(rims.begin(), rims.end(), row);
    return active ? surface_->poisson->active_place(row) : -1;
  };
  // Of a vertex without a place, one that has: the nearest by edges.
  const auto near_with_place = [&](int vertex) {
    std::vector<int> front{vertex};
    std::vector<char> reached(static_cast<size_t>(surface_->mesh.vertex_count()), 0);
    for (size_t i = 0; i < front.size(); ++i) {
      if (place(front[i]) >= 0) return front[i];
      for (int j : fans.of(front[i]))
        for (int k = 0; k < 3; ++k)
          if (!std::exchange(reached[t(j, k)], 1)) front.push_back(t(j, k));
    }
    return vertex;
  };
  std::vector<Share> shares;
  for (int i = 0; i < fine.poisson->active_vertex_count(); ++i) {
    const int v = fine.poisson->active_vertex(i);
    const int near = of_vertex_[v];
    Eigen::Vector3i corners(near, near, near);
    Eigen::Vector3d weights(1, 0, 0);
    if (vertex_[near] != v)
      find_triangle(p, t, fans, fine.mesh.positions.row(v), near, corners, weights);
    Share share;
    for (int k = 0; k < 3; ++k) {
      share.place[k] = place(corners[k]);
      if (share.place[k] < 0) share.place[k] = std::max(0, place(near_with_place(corners[k])));
      share.weight[k] = weights[k] / weights.sum();
    }
    shares.push_back(share);
  }
  return shares;
}

double CoarseSurface::bytes() const {
  return surface_->bytes() +
         static_cast<double>((vertex_.size() + of_vertex_.size() + fine_row_.size()) * sizeof(int));
}

}  // namespace dd
