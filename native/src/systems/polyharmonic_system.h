// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "solver/updated_cholesky.h"
#include "systems/energy_block.h"
#include "systems/free_block.h"

namespace dd {

/// K on the free vertices, factored once: solutions of K x = 0 with given values at the constrained
/// vertices, the smoothest functions that take them on.
class PolyharmonicSystem {
 public:
  /// operators: of the geometry that K is built on. All but the smoothness and what the options
  /// hold by value must outlive the system. Throws UnsolvableSurface where K is singular.
  PolyharmonicSystem(const SurfaceOperators& operators, const Region& region,
                     Smoothness smoothness = Smoothness::thin_plate,
                     const BlockOptions& options = {});
  /// block: energy_block() of these, where it is at hand.
  PolyharmonicSystem(const SurfaceOperators& operators, const Region& region, Smoothness smoothness,
                     const EnergyBlock& block, const BlockOptions& options);

  /// For a system of the same region and smoothness.
  std::shared_ptr<const SymbolicCholesky> symbolic() const { return factor_->shared_symbolic(); }

  /// What solves for four columns work in, to be kept between them.
  struct Space {
    Rows values;  ///< n×4: what is given, and then the extension
    EnergyProduct::Space product;
    Rows solution;  ///< F×4
    SparseCholesky::Space solve;
  };

  /// K_FF x_F = −K_FC x_C. values: n×k; only the rows of constrained vertices are read.
  /// Returns F×k, rows as in Region::free. one_solve_error, where not null: how far one solve alone
  /// is off in any of the columns, of the column's largest value.
  /// Throws UnsolvableSurface where the solution can't be had to six digits.
  RowMatrix extend(const RowMatrix& values, double* one_solve_error = nullptr) const;
  /// The same of space.values. Returns F×4, in space.
  const Rows& extend(Space& space, double* one_solve_error = nullptr) const;

  const SurfaceOperators& operators() const { return operators_; }
  Smoothness smoothness() const { return smoothness_; }
  /// K's own, which may outlive the system.
  std::shared_ptr<const UpdatedCholesky> factor() const { return factor_; }

 private:
  const SurfaceOperators& operators_;
  const Region& region_;
  Smoothness smoothness_;
  std::shared_ptr<const UpdatedCholesky> factor_;
  ThreadPool* pool_;
};

}  // namespace dd
