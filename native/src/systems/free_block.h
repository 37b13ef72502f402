// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "solver/fill_reducing_order.h"
#include "solver/sparse_cholesky.h"
#include "systems/region.h"

namespace dd {

/// The columns of a matrix that belong to free vertices: F of its n.
SparseMatrix free_columns(const SparseMatrix& matrix, const Region& region);

/// The rows and columns of a symmetric n×n matrix that belong to free vertices: F×F.
SparseMatrix free_block(const SparseMatrix& matrix, const Region& region);

/// The rows of values that belong to free vertices.
RowMatrix free_rows(const RowMatrix& values, const Region& region);

/// Thrown where a system of the surface is singular; names a vertex near the breakdown.
class UnsolvableSurface : public Error {
 public:
  explicit UnsolvableSurface(int vertex);
  int vertex() const { return vertex_; }

 private:
  int vertex_;
};

/// Nested dissection of the free vertices by the graph of an F×F block. It also orders blocks whose
/// graph is a power of that one, as K's is of L's.
Dissection free_dissection(const SparseMatrix& block, const Region& region,
                           const Positions& positions, ThreadPool* pool = nullptr);

struct BlockOptions : FactorOptions {
  /// Nested dissection of the free vertices; null: minimum-degree order.
  const Dissection* dissection = nullptr;
  /// Symbolic factorization of a block with the same pattern, to be reused; null: computed.
  std::shared_ptr<const SymbolicCholesky> symbolic = nullptr;
};

/// Factors an F×F block. Throws UnsolvableSurface where SparseCholesky finds it singular.
SparseCholesky factor_free_block(const SparseMatrix& block, const Region& region,
                                 const BlockOptions& options = {});

}  // namespace dd
