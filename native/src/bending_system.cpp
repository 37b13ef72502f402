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

SparseMatrix free_block(const SparseMatrix& matrix, const Region& region) {
  const SparseMatrix rows = free_columns(matrix, region).transpose();
  return free_columns(rows, region);
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

SparseMatrix bi_laplacian_block(const SurfaceOperators& operators, const Region& region) {
  const SparseMatrix columns = free_columns(operators.laplacian, region);
  return SparseMatrix(columns.transpose() * operators.masses.cwiseInverse().asDiagonal() * columns);
}

}  // namespace

BendingSystem::BendingSystem(const SurfaceOperators& operators, const Region& region)
    : operators_(operators),
      region_(region),
      factor_(factor_free_block(bi_laplacian_block(operators, region), region)) {}

RowMatrix BendingSystem::apply(const RowMatrix& values) const {
  const RowMatrix curvature =
      operators_.masses.cwiseInverse().asDiagonal() * RowMatrix(operators_.laplacian * values);
  return operators_.laplacian * curvature;
}

RowMatrix BendingSystem::extend(const RowMatrix& values) const {
  RowMatrix x = values;
  for (int v : region_.free) x.row(v).setZero();
  // The second round is iterative refinement: where triangles are thin, K spans many magnitudes
  // and its factor loses digits that the product L (M⁻¹ (L x)) still has.
  for (int round = 0; round < 2; ++round) {
    const RowMatrix correction = factor_.solve(free_rows(-apply(x), region_));
    for (int r = 0; r < region_.free_count(); ++r) x.row(region_.free[r]) += correction.row(r);
  }
  return free_rows(x, region_);
}

}  // namespace dd
