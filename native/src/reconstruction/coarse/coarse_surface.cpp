// SPDX-License-Identifier: GPL-3.0-or-later
#include "reconstruction/coarse/coarse_surface.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numeric>
#include <utility>

#include "mesh/topology.h"

namespace dd {

namespace {

// Largest fraction of the free vertices that may remain. Break-even: with more, the coarse surface
// saves too little.
constexpr double kMaxCoarseFraction = 0.6;

// Largest relative difference of two spacings that count as the same: they are made of areas that
// are summed in different orders.
constexpr double kSameSpacing = 1e-9;

/// That of the bind, if it is the same.
std::shared_ptr<const CoarseMesh> contraction_of(const FactoredSurface& fine, double spacing,
                                                 double growth) {
  if (fine.contraction && fine.contraction->growth == growth &&
      std::abs(fine.contraction->spacing - spacing) <= kSameSpacing * spacing)
    return fine.contraction;
  return contract_active(fine.mesh, fine.region, fine.operators.triangles, spacing, growth);
}

}  // namespace

std::unique_ptr<CoarseSurface> CoarseSurface::make(const FactoredSurface& fine, double spacing,
                                                   double growth) {
  const Region& region = fine.region;
  std::shared_ptr<const CoarseMesh> contraction = contraction_of(fine, spacing, growth);
  const CoarseMesh& made = *contraction;
  if (made.free_count > kMaxCoarseFraction * region.free_count()) return nullptr;

  std::unique_ptr<CoarseSurface> coarse(new CoarseSurface);
  coarse->region_ = region_of_roles(made.roles, region.handle_count);
  for (int v : region.grounds) coarse->region_.grounds.push_back(made.of_vertex[v]);
  coarse->surface_ =
      std::make_unique<FactoredSurface>(made.mesh, coarse->region_, Triangulation::delaunay,
                                        fine.stiffness.of_coarse(made.of_vertex, coarse->region_));
  BlockOptions options;
  options.pool = &fine.poisson->pool();
  options.precision = fine.poisson->precision();
  FactoredSurface& surface = *coarse->surface_;
  try {
    surface.factor(free_block(surface.operators.laplacian, coarse->region_), options);
  } catch (const UnsolvableSurface&) {
    return nullptr;  // an error of the coarse surface only, which names its own vertices
  }
  for (int v : surface.order().vertex_of_row)
    coarse->fine_row_.push_back(fine.order().row_of_vertex[made.vertices[v]]);
  coarse->contraction_ = std::move(contraction);
  return coarse;
}

Triangles CoarseSurface::with_surroundings(const FactoredSurface& fine) const {
  const std::vector<int> inside = active_faces(fine.mesh, fine.region, fine.operators.triangles);
  std::vector<int> all(size_t(fine.mesh.triangle_count())), outside;
  std::iota(all.begin(), all.end(), 0);
  std::set_difference(all.begin(), all.end(), inside.begin(), inside.end(),
                      std::back_inserter(outside));
  const Triangles& own = surface_->mesh.triangles;
  Triangles found(own.rows() + static_cast<Index>(outside.size()), 3);
  for (Index j = 0; j < own.rows(); ++j)
    for (int k = 0; k < 3; ++k) found(j, k) = vertices()[size_t(own(j, k))];
  found.bottomRows(static_cast<Index>(outside.size())) = fine.mesh.triangles(outside, kAllIndices);
  return found;
}

void CoarseSurface::restrict(const Rows& fine, Rows& coarse) const {
  coarse.resize(static_cast<Index>(fine_row_.size()), 4);
  for (size_t r = 0; r < fine_row_.size(); ++r)
    coarse.row(static_cast<Index>(r)) = fine.row(fine_row_[r]);
}

std::vector<CoarseSurface::Stencil> CoarseSurface::stencils(const FactoredSurface& fine) const {
  const Triangles& t = surface_->mesh.triangles;
  const VertexTriangles fans(t, surface_->mesh.vertex_count());
  const auto active_index = [&](int vertex) {
    return surface_->poisson->active_index_of_vertex(vertex);
  };
  // The active vertex nearest to a vertex along edges, by breadth-first search.
  const auto nearest_active = [&](int vertex) {
    std::vector<int> front{vertex};
    std::vector<char> reached(static_cast<size_t>(surface_->mesh.vertex_count()), 0);
    for (size_t i = 0; i < front.size(); ++i) {
      if (active_index(front[i]) >= 0) return front[i];
      for (int j : fans.of(front[i]))
        for (int k = 0; k < 3; ++k)
          if (!std::exchange(reached[t(j, k)], 1)) front.push_back(t(j, k));
    }
    return vertex;
  };
  std::vector<Stencil> stencils;
  for (int i = 0; i < fine.poisson->active_vertex_count(); ++i) {
    const int v = fine.poisson->active_vertex(i);
    const int near = contraction_->of_vertex[size_t(v)];
    PointOnTriangle at;
    if (vertices()[size_t(near)] != v)
      at = point_near(surface_->mesh, fans, fine.mesh.positions.row(v), near);
    if (at.triangle < 0) at.barycentric = {1, 0, 0};
    Stencil stencil;
    for (int k = 0; k < 3; ++k) {
      const int corner = at.triangle < 0 ? near : t(at.triangle, k);
      stencil.active_index[k] = active_index(corner);
      if (stencil.active_index[k] < 0)
        stencil.active_index[k] = std::max(0, active_index(nearest_active(corner)));
      stencil.weight[k] = at.barycentric[k];
    }
    stencils.push_back(stencil);
  }
  return stencils;
}

double CoarseSurface::bytes() const {
  return surface_->bytes() +
         static_cast<double>(
             (contraction_->vertices.size() + contraction_->of_vertex.size() + fine_row_.size()) *
             sizeof(int));
}

}  // namespace dd
