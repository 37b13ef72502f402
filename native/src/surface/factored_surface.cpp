// SPDX-License-Identifier: GPL-3.0-or-later
#include "surface/factored_surface.h"

#include <utility>

namespace dd {

FactoredSurface::FactoredSurface(Mesh its_mesh, const Region& its_region)
    : mesh(std::move(its_mesh)),
      region(its_region),
      operators(surface_operators(mesh.positions, mesh.triangles)) {}

void FactoredSurface::factor(SparseMatrix block, const BlockOptions& options) {
  poisson = std::make_unique<PoissonSystem>(mesh, region, operators, std::move(block), options);
  rest = in_order(mesh.positions, order());
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
