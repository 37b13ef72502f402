// SPDX-License-Identifier: GPL-3.0-or-later
#include "base/base_surface.h"

#include "systems/free_block.h"

namespace dd {

namespace {

/// Positions padded to rows of four by a column of zeros.
Rows four_columns(const Positions& positions) {
  Rows rows = Rows::Zero(positions.rows(), 4);
  rows.leftCols<3>() = positions;
  return rows;
}

}  // namespace

Positions base_surface(const PolyharmonicSystem& bending, const Region& region,
                       const Positions& positions, const Eigen::VectorXd& fourth_column,
                       double* single_solve_error) {
  Positions base = positions;
  PolyharmonicSystem::Scratch space;
  space.values = four_columns(positions);
  if (fourth_column.size() > 0) space.values.col(3) = fourth_column;
  const Rows& free = bending.extend(space, single_solve_error);
  for (int r = 0; r < region.free_count(); ++r)
    base.row(region.free[r]) = free.row(r).leftCols<3>();
  return base;
}

Positions faired_surface(const Mesh& mesh, const SurfaceOperators& operators, double edge_lengths) {
  const double step = edge_lengths * mean_edge_length(mesh.positions, mesh.triangles);
  SparseMatrix system = operators.laplacian * (step * step);
  // The row of L of a vertex without triangles is zero: M alone makes the system regular there.
  system += SparseMatrix(operators.masses.asDiagonal());
  try {
    return SparseCholesky(system).solve(operators.masses.asDiagonal() * mesh.positions);
  } catch (const SingularMatrix& singular) {
    throw UnsolvableSurface(singular.row());
  }
}

Positions smoothed_surface(const Positions& positions, const SurfaceOperators& operators,
                           const Region& region, double length) {
  const double weight = length * length * length * length;
  const EnergyBlock energy = energy_block(operators, region, Smoothness::thin_plate);
  SparseMatrix system = weight * energy.sparse;
  for (int r = 0; r < region.free_count(); ++r)
    system.coeffRef(r, r) += operators.masses[region.free[r]];
  // The unknown is the displacement x − p, which is zero at constrained vertices.
  const Rows values = four_columns(positions);
  EnergyProduct::Scratch space;
  const EnergyProduct product(operators, Smoothness::thin_plate, values, space, nullptr);
  const UpdatedCholesky factor(factor_free_block(system, region), energy.vectors,
                               weight * energy.core, nullptr);
  Rows displacement;
  SparseCholesky::SolveScratch solve;
  factor.solve_rows(
      [&](int r) -> Eigen::RowVector4d { return -weight * product.row(region.free[size_t(r)]); },
      displacement, solve, nullptr);
  Positions smoothed = positions;
  for (int r = 0; r < region.free_count(); ++r)
    smoothed.row(region.free[r]) += displacement.row(r).leftCols<3>();
  return smoothed;
}

}  // namespace dd
