// SPDX-License-Identifier: GPL-3.0-or-later
#include "bending_system.h"

#include <string>

namespace dd {

SparseMatrix free_columns(const SparseMatrix& matrix, const Region& region) {
  SparseMatrix columns(matrix.rows(), region.free_count());
  Eigen::VectorXi sizes(region.free_count());
  for (int r = 0; r < region.free_count(); ++r)
    sizes[r] = static_cast<int>(matrix.col(region.free[r]).nonZeros());
  columns.reserve(sizes);
  for (int r = 0; r < region.free_count(); ++r)
    for (SparseMatrix::InnerIterator it(matrix, region.free[r]); it; ++it)
      columns.insert(it.row(), r) = it.value();
  columns.makeCompressed();
  return columns;
}

SparseCholesky factor_free_block(const SparseMatrix& block, const Region& region) {
  try {
    return SparseCholesky(block);
  } catch (const SingularMatrix& singular) {
    throw Error(Status::numeric,
                "The surface can't be solved for near vertex " +
                    std::to_string(region.free[singular.row()]) +
                    ": its triangles are degenerate or nothing holds them. Merge doubled vertices "
                    "and dissolve degenerate faces there, or leave that part out of the region.");
  }
}

namespace {

RowMatrix free_rows(const RowMatrix& values, const Region& region) {
  RowMatrix rows(region.free_count(), values.cols());
  for (int r = 0; r < region.free_count(); ++r) rows.row(r) = values.row(region.free[r]);
  return rows;
}

SparseMatrix bi_laplacian_block(const SparseMatrix& laplacian,
                                const Eigen::VectorXd& inverse_masses, const Region& region) {
  const SparseMatrix columns = free_columns(laplacian, region);
  return SparseMatrix(columns.transpose() * inverse_masses.asDiagonal() * columns);
}

}  // namespace

BendingSystem::BendingSystem(const TriangleMetric& metric, const Triangles& triangles,
                             const Region& region)
    : region_(region),
      laplacian_(cotangent_laplacian(metric, triangles, static_cast<int>(region.role.size()))),
      inverse_masses_(mixed_voronoi_masses(metric, triangles, static_cast<int>(region.role.size()))
                          .cwiseInverse()),
      factor_(factor_free_block(bi_laplacian_block(laplacian_, inverse_masses_, region), region)) {}

RowMatrix BendingSystem::extend(const RowMatrix& values) const {
  RowMatrix x = values;
  for (int v : region_.free) x.row(v).setZero();
  // The second round is iterative refinement: where triangles are thin, K spans many magnitudes
  // and its factor loses digits that the product L (M⁻¹ (L x)) still has.
  for (int round = 0; round < 2; ++round) {
    const RowMatrix residual =
        laplacian_ * RowMatrix(inverse_masses_.asDiagonal() * RowMatrix(laplacian_ * x));
    const RowMatrix correction = factor_.solve(free_rows(-residual, region_));
    for (int r = 0; r < region_.free_count(); ++r) x.row(region_.free[r]) += correction.row(r);
  }
  return free_rows(x, region_);
}

}  // namespace dd
