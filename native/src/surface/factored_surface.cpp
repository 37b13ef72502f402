// SPDX-License-Identifier: GPL-3.0-or-later
#include "surface/factored_surface.h"

#include <cmath>
#include <utility>

namespace dd {

FactoredSurface::FactoredSurface(Mesh its_mesh, const Region& its_region)
    : mesh(std::move(its_mesh)),
      region(its_region),
      operators(surface_operators(mesh.positions, mesh.triangles)) {}

void FactoredSurface::factor(SparseMatrix block, BlockOptions options) {
  if (!dissection) dissection = free_dissection(block, region, mesh.positions);
  options.dissection = &*dissection;
  poisson = std::make_unique<PoissonSystem>(mesh, region, operators, std::move(block), options);
  rest = in_order(mesh.positions, order());
  double area = 0;
  for (int j : poisson->active().triangles) area += operators.metric.areas[j];
  active_size = std::sqrt(area);
}

double FactoredSurface::bytes() const {
  const auto doubles = mesh.positions.size() + operators.metric.cotangents.size() +
                       operators.metric.areas.size() + operators.masses.size() + rest.size();
  return static_cast<double>(doubles) * sizeof(double) +
         static_cast<double>(mesh.triangles.size()) * sizeof(int) +
         static_cast<double>(operators.laplacian.nonZeros()) * (sizeof(double) + sizeof(int)) +
         poisson->bytes();
}

Rows in_order(const Positions& positions, const RowOrder& order) {
  Rows rows = Rows::Zero(order.count(), 4);
  for (int r = 0; r < order.count(); ++r)
    rows.row(r).head<3>() = positions.row(order.vertex_of_row[r]);
  return rows;
}

}  // namespace dd
