// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "solver/sparse_forward.h"
#include "systems/polyharmonic_system.h"

namespace dd {

/// Solutions of K x = 0 with given values at the handles' vertices and zero at fixed ones, by one
/// solve with the factor of a PolyharmonicSystem each: what a frame can afford. It needs nothing
/// of the geometry that K was built on.
class HandleSolve {
 public:
  /// pool: null, or outlives it.
  HandleSolve(const PolyharmonicSystem& bending, const Region& region, ThreadPool* pool);

  /// What solves work in, to be kept between them.
  struct Space {
    std::vector<Rows> forces;  ///< after each step
    Rows solution;
    SparseCholesky::Space solve;
  };
  /// values: a row for each of Region::handle_vertices. Returns F×4, rows as in Region::free, in
  /// space.
  const Rows& extend(const Rows& values, Space& space) const;

  /// Makes what add_extended() needs. at_handles: V, a row for each of Region::handle_vertices.
  /// row_of_free: of each of Region::free, the row of what that works on. precision: single where
  /// frames may use the factor so, if it is exact enough for that.
  void prepare_frames(SparseMatrix at_handles, const std::vector<int>& row_of_free,
                      Precision precision);

  /// For a frame: out = rest + the extension of V C, in rows of free vertices. coefficients: C, the
  /// fourth column 0.
  void add_extended(const Rows& coefficients, const Rows& rest, Rows& out);

  /// Whether a frame needs the second half of a solve alone.
  bool first_half_is_ready() const { return !forward_.empty(); }
  /// Whether that is in single precision.
  bool in_single() const { return single_ != nullptr; }

  double bytes() const;

 private:
  /// done as of SparseCholesky.
  template <class Done>
  void solve_second_half(const SparseCholesky& factor, const Rows& coefficients,
                         SparseCholesky::Space& space, const Done& done, Columns columns) const;
  double error_of(const SparseCholesky& single) const;

  std::shared_ptr<const UpdatedCholesky> factor_;
  // −K_FC = −L_FT M⁻¹ L_TC and the like: from the handles' vertices outwards, an L at a time, where
  // free vertices can feel it. One matrix of them all would be full around a hub.
  std::vector<SparseMatrix> steps_;
  ThreadPool* pool_;
  // Of add_extended().
  SparseMatrix at_handles_;                 // V
  SparseForward forward_;                   // of −K_FC V, where that is half the factor at most
  std::unique_ptr<SparseCholesky> single_;  // the factor for what comes after forward_, or null
  std::vector<int> out_row_;                // of each place in the factor
  Space space_;
};

}  // namespace dd
