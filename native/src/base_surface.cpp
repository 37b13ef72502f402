// SPDX-License-Identifier: GPL-3.0-or-later
#include "base_surface.h"

namespace dd {

Positions base_surface(const BendingSystem& bending, const Region& region,
                       const Positions& positions) {
  Positions base = positions;
  const RowMatrix free = bending.extend(positions);
  for (int r = 0; r < region.free_count(); ++r) base.row(region.free[r]) = free.row(r);
  return base;
}

Positions faired_surface(const Mesh& mesh, const TriangleMetric& metric, double edge_lengths) {
  const int n = mesh.vertex_count();
  const double step = edge_lengths * mean_edge_length(mesh.positions, mesh.triangles);
  const Eigen::VectorXd masses = mixed_voronoi_masses(metric, mesh.triangles, n);
  SparseMatrix system = cotangent_laplacian(metric, mesh.triangles, n) * (step * step);
  // Loose vertices have no entry in L: the mass alone keeps them where they are.
  system += SparseMatrix(masses.asDiagonal());
  return SparseCholesky(system).solve(masses.asDiagonal() * mesh.positions);
}

}  // namespace dd
