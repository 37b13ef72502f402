// SPDX-License-Identifier: GPL-3.0-or-later
#include "systems/free_block.h"

#include <string>
#include <utility>

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

RowMatrix free_rows(const RowMatrix& values, const Region& region) {
  RowMatrix rows(region.free_count(), values.cols());
  for (int r = 0; r < region.free_count(); ++r) rows.row(r) = values.row(region.free[r]);
  return rows;
}

UnsolvableSurface::UnsolvableSurface(int vertex)
    : Error(
          Status::numeric,
          "The surface can't be solved for near vertex " + std::to_string(vertex) +
              ": its triangles are degenerate, or too far from what holds them. Merge doubled "
              "vertices and dissolve degenerate faces there, add a handle, or leave that part out "
              "of the region."),
      vertex_(vertex) {}

Dissection free_dissection(const SparseMatrix& block, const Region& region,
                           const Positions& positions) {
  Positions places(region.free_count(), 3);
  for (int r = 0; r < region.free_count(); ++r) places.row(r) = positions.row(region.free[r]);
  return Dissection(block, places);
}

SparseCholesky factor_free_block(const SparseMatrix& block, const Region& region,
                                 const BlockOptions& options) {
  try {
    std::shared_ptr<const SymbolicCholesky> symbolic = options.symbolic;
    if (!symbolic)
      symbolic = std::make_shared<SymbolicCholesky>(
          block, options.dissection ? options.dissection->order(block) : minimum_degree(block));
    return SparseCholesky(block, std::move(symbolic), options);
  } catch (const SingularMatrix& singular) {
    throw UnsolvableSurface(region.free[singular.row()]);
  }
}

}  // namespace dd
