// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "solver/sparse_cholesky.h"
#include "systems/free_block.h"
#include "systems/operators.h"
#include "systems/region.h"

namespace dd {

/// The energy whose minimizer is the base surface: K = L (M⁻¹ L)^(order − 1).
enum class Smoothness {
  membrane = 1,            ///< least area: continuous at the border
  thin_plate = 2,          ///< least curvature: tangents continuous, the paper's choice
  curvature_variation = 3  ///< least variation of curvature: curvature continuous
};

/// The F×F block of K that belongs to free vertices.
SparseMatrix free_block_of_energy(const SurfaceOperators& operators, const Region& region,
                                  Smoothness smoothness);

/// K times the columns of values, n×k.
RowMatrix apply_energy(const SurfaceOperators& operators, const RowMatrix& values,
                       Smoothness smoothness);

/// K on the free vertices, factored once: solutions of K x = 0 with given values at the constrained
/// vertices, the smoothest functions that take them on.
class PolyharmonicSystem {
 public:
  /// operators: of the geometry that K is built on. All but the smoothness and what the options
  /// hold by value must outlive the system. Throws UnsolvableSurface where K is singular.
  PolyharmonicSystem(const SurfaceOperators& operators, const Region& region,
                     Smoothness smoothness = Smoothness::thin_plate,
                     const BlockOptions& options = {});
  /// block: free_block_of_energy() of these, where it is at hand.
  PolyharmonicSystem(const SurfaceOperators& operators, const Region& region, Smoothness smoothness,
                     const SparseMatrix& block, const BlockOptions& options);

  /// For a system of the same region and smoothness.
  std::shared_ptr<const SymbolicCholesky> symbolic() const { return factor_.shared_symbolic(); }

  /// K_FF x_F = −K_FC x_C. values: n×k; only the rows of constrained vertices are read.
  /// Returns F×k, rows as in Region::free.
  /// Throws UnsolvableSurface where the solution can't be had to six digits.
  RowMatrix extend(const RowMatrix& values) const;

 private:
  const SurfaceOperators& operators_;
  const Region& region_;
  Smoothness smoothness_;
  SparseCholesky factor_;
  ThreadPool* pool_;
};

}  // namespace dd
