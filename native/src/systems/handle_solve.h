// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "solver/sparse_forward.h"
#include "systems/polyharmonic_system.h"

namespace dd {

/// Solves K x = 0 with given values at the handles' vertices and zero at fixed ones by one solve
/// with the factor of a PolyharmonicSystem, without iterative refinement: fast enough for a frame.
/// The operators that K was built from may be released once this is constructed.
class HandleSolve {
 public:
  /// pool: null, or must outlive this.
  HandleSolve(const PolyharmonicSystem& energy_system, const Region& region, ThreadPool* pool);

  /// Buffers of solves, to be kept between them.
  struct Scratch {
    std::vector<Rows> forces;  ///< results of the steps_
    Rows solution;
    SparseCholesky::SolveScratch solve;
  };
  /// values: a row for each of Region::handle_vertices. Returns F×4 in scratch, rows as in
  /// Region::free.
  const Rows& extend(const Rows& values, Scratch& scratch) const;

  /// Prepares add_extended(). at_handles: V, a row for each of Region::handle_vertices.
  /// row_of_free: for each of Region::free its row in rest and out. precision: with single, frames
  /// use the factor in single precision if it is accurate enough.
  void prepare_frames(SparseMatrix at_handles, const std::vector<int>& row_of_free,
                      Precision precision);

  /// For a frame: the free rows of out = rest + the extension of V C. coefficients: C, the fourth
  /// column 0.
  void add_extended(const Rows& coefficients, const Rows& rest, Rows& out);

  /// Whether forward substitution is precomputed, so that a frame only substitutes backward.
  bool has_precomputed_forward() const { return !forward_.empty(); }
  /// Whether that is done in single precision.
  bool in_single() const { return single_ != nullptr; }

  double bytes() const;

 private:
  /// done: see SparseCholesky::backward_solve().
  template <class Done>
  void backward_solve(const SparseCholesky& factor, const Rows& coefficients,
                      SparseCholesky::SolveScratch& scratch, const Done& done,
                      Columns columns) const;
  double error_of(const SparseCholesky& single) const;

  std::shared_ptr<const UpdatedCholesky> factor_;
  // −K_FC in sparse factors to be applied in this order, such as M⁻¹ L_TC, then −L_FT; each has
  // only the rows that influence free vertices. Their product would be dense around a hub.
  std::vector<SparseMatrix> steps_;
  ThreadPool* pool_;
  // For add_extended():
  SparseMatrix at_handles_;                 // V
  SparseForward forward_;                   // of −K_FC V, unless it exceeds half of the factor
  std::unique_ptr<SparseCholesky> single_;  // the factor for backward substitution, or null
  std::vector<int> out_row_;                // row of out for each index of the factor
  Scratch scratch_;
};

}  // namespace dd
