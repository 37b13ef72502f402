// SPDX-License-Identifier: GPL-3.0-or-later
#include "systems/free_block.h"

#include <string>
#include <utility>

namespace dd {

namespace {

/// The columns of free vertices, reduced to the rows with number_of(row) >= 0, which these numbers
/// replace. They must increase with the row.
template <class NumberOf>
SparseMatrix chosen(const SparseMatrix& matrix, const Region& region, Index rows,
                    const NumberOf& number_of) {
  SparseMatrix result(rows, region.free_count());
  Index most = 0;
  for (int v : region.free) most += matrix.col(v).nonZeros();
  result.reserve(most);
  for (int r = 0; r < region.free_count(); ++r) {
    result.startVec(r);
    for (SparseMatrix::InnerIterator it(matrix, region.free[r]); it; ++it) {
      const int row = number_of(static_cast<int>(it.row()));
      if (row >= 0) result.insertBackByOuterInner(r, row) = it.value();
    }
  }
  result.finalize();
  return result;
}

}  // namespace

SparseMatrix free_columns(const SparseMatrix& matrix, const Region& region) {
  return chosen(matrix, region, matrix.rows(), [](int row) { return row; });
}

SparseMatrix free_block(const SparseMatrix& matrix, const Region& region) {
  return chosen(matrix, region, region.free_count(), [&](int row) { return region.row[row]; });
}

RowMatrix free_rows(const RowMatrix& values, const Region& region) {
  RowMatrix rows(region.free_count(), values.cols());
  for (int r = 0; r < region.free_count(); ++r) rows.row(r) = values.row(region.free[r]);
  return rows;
}

UnsolvableSurface::UnsolvableSurface(int vertex)
    : Error(Status::numeric, {Subject::vertex, vertex},
            "lies where the surface can't be solved for, since triangles are degenerate or too far "
            "from what holds them",
            Remedy::dissolve_faces, {vertex}),
      vertex_(vertex) {}

Dissection free_dissection(const SparseMatrix& block, const Region& region,
                           const Positions& positions, ThreadPool* pool) {
  Positions free_positions(region.free_count(), 3);
  for (int r = 0; r < region.free_count(); ++r)
    free_positions.row(r) = positions.row(region.free[r]);
  return Dissection(block, free_positions, pool);
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
