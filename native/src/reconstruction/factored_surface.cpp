// SPDX-License-Identifier: GPL-3.0-or-later
#include "reconstruction/factored_surface.h"

#include <cmath>
#include <utility>

namespace dd {

namespace {

double bytes_of(const SurfaceOperators& operators) {
  const auto doubles = operators.metric.cotangents.size() + operators.metric.areas.size() +
                       operators.stiffness.size() + operators.masses.size();
  return static_cast<double>(doubles) * sizeof(double) +
         static_cast<double>(operators.triangles.size()) * sizeof(int) +
         static_cast<double>(operators.laplacian.nonZeros()) * (sizeof(double) + sizeof(int));
}

}  // namespace

FactoredSurface::FactoredSurface(Mesh its_mesh, const Region& its_region,
                                 Triangulation triangulation, Stiffness its_stiffness)
    : mesh(std::move(its_mesh)),
      region(its_region),
      stiffness(std::move(its_stiffness)),
      operators(surface_operators(mesh.positions, mesh.triangles, triangulation)) {
  if (!stiffness.varies()) return;
  even = std::move(operators);
  operators = stiffened(*even, stiffness);
}

void FactoredSurface::factor(SparseMatrix block, BlockOptions options) {
  if (!dissection) dissection = free_dissection(block, region, mesh.positions, options.pool);
  options.dissection = &*dissection;
  poisson = std::make_unique<PoissonSystem>(mesh, region, operators, std::move(block), options);
  rest = in_order(mesh.positions, order());
  double area = 0;
  for (int j : poisson->active().triangles) area += operators.metric.areas[j];
  active_size = std::sqrt(area);
}

std::vector<int> FactoredSurface::faces_with_free_corners() const {
  if (!operators.flipped) return poisson->active().triangles;
  return triangles_with_free_corners(region, mesh.triangles);
}

double FactoredSurface::bytes() const {
  return static_cast<double>(mesh.positions.size() + rest.size()) * sizeof(double) +
         static_cast<double>(mesh.triangles.size()) * sizeof(int) + bytes_of(operators) +
         (even ? bytes_of(*even) : 0) + stiffness.bytes() + poisson->bytes();
}

Rows in_order(const Positions& positions, const RowOrder& order) {
  Rows rows = Rows::Zero(order.count(), 4);
  for (int r = 0; r < order.count(); ++r)
    rows.row(r).head<3>() = positions.row(order.vertex_of_row[r]);
  return rows;
}

}  // namespace dd
