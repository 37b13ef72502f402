// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "solver/updated_cholesky.h"
#include "systems/energy_block.h"
#include "systems/free_block.h"

namespace dd {

/// K factored on the free vertices. Solves K x = 0 with given values at the constrained vertices:
/// the functions of least energy with these values.
class PolyharmonicSystem {
 public:
  /// operators: of the geometry that K is built on. They, the region and the pool must outlive the
  /// system. Throws UnsolvableSurface where K is singular.
  PolyharmonicSystem(const SurfaceOperators& operators, const Region& region,
                     Smoothness smoothness = Smoothness::thin_plate,
                     const BlockOptions& options = {});
  /// block: energy_block() of the same arguments, where it is already computed.
  PolyharmonicSystem(const SurfaceOperators& operators, const Region& region, Smoothness smoothness,
                     const EnergyBlock& block, const BlockOptions& options);

  /// To be reused for a system of the same region and smoothness.
  std::shared_ptr<const SymbolicCholesky> symbolic() const { return factor_->shared_symbolic(); }

  /// Buffers of extend() for four columns, to be kept between calls.
  struct Scratch {
    Rows values;  ///< n×4; in: values at constrained vertices, out: extended
    EnergyProduct::Scratch product;
    Rows solution;  ///< F×4
    SparseCholesky::SolveScratch solve;
  };

  /// Solves K_FF x_F = −K_FC x_C by iterative refinement. values: n×k; only the rows of constrained
  /// vertices are read. Returns F×k, rows as in Region::free. one_solve_error: null, or receives
  /// the error of one solve without refinement, as a fraction of its column's largest value, for
  /// the worst column. Throws UnsolvableSurface where the last correction stays above 1e-6 of the
  /// largest value.
  RowMatrix extend(const RowMatrix& values, double* one_solve_error = nullptr) const;
  /// The same for scratch.values. Returns F×4, in scratch.
  const Rows& extend(Scratch& scratch, double* one_solve_error = nullptr) const;

  const SurfaceOperators& operators() const { return operators_; }
  Smoothness smoothness() const { return smoothness_; }
  /// K's factor, which may outlive the system.
  std::shared_ptr<const UpdatedCholesky> factor() const { return factor_; }

 private:
  const SurfaceOperators& operators_;
  const Region& region_;
  Smoothness smoothness_;
  std::shared_ptr<const UpdatedCholesky> factor_;
  ThreadPool* pool_;
};

}  // namespace dd
