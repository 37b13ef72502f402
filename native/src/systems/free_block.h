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

/// The refusal of a surface that can't be solved for near that vertex.
class UnsolvableSurface : public Error {
 public:
  explicit UnsolvableSurface(int vertex);
  int vertex() const { return vertex_; }

 private:
  int vertex_;
};

/// Dissects the free vertices by the graph of a free×free block. Blocks whose graph is a power of
/// that one, as K's is of L's, are ordered by the same dissection.
Dissection free_dissection(const SparseMatrix& block, const Region& region,
                           const Positions& positions, ThreadPool* pool = nullptr);

struct BlockOptions : FactorOptions {
  /// Of the free vertices, where they have places; else the order is one of minimum degree.
  const Dissection* dissection = nullptr;
  /// Of a block of the same pattern, to be used again.
  std::shared_ptr<const SymbolicCholesky> symbolic = nullptr;
};

/// Factors a free×free block. Throws UnsolvableSurface where SparseCholesky finds it singular.
SparseCholesky factor_free_block(const SparseMatrix& block, const Region& region,
                                 const BlockOptions& options = {});

}  // namespace dd
