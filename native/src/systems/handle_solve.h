// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "systems/polyharmonic_system.h"

namespace dd {

/// Solutions of K x = 0 with given values at the handles' vertices and zero at fixed ones, by one
/// solve with the factor of a PolyharmonicSystem each: what a frame can afford. It needs nothing
/// of the geometry that K was built on.
class HandleSolve {
 public:
  /// pool: null, or outlives it. row_of_free: of each of Region::free, the row of what
  /// add_extended() works on; without it there is none.
  HandleSolve(const PolyharmonicSystem& bending, const Region& region, ThreadPool* pool,
              const std::vector<int>& row_of_free = {});

  /// values: a row for each of Region::handle_vertices. Returns F×k, rows as in Region::free.
  RowMatrix extend(const RowMatrix& values) const;

  /// The same of three columns, for a frame: out = rest + what it returns, in rows of free
  /// vertices. values: the fourth column 0.
  void add_extended(const Rows& values, const Rows& rest, Rows& out);

  double bytes() const;

 private:
  std::shared_ptr<const UpdatedCholesky> factor_;
  // −K_FC = −L_FT M⁻¹ L_TC and the like: from the handles' vertices outwards, an L at a time, where
  // free vertices can feel it. One matrix of them all would be full around a hub.
  std::vector<SparseMatrix> steps_;
  ThreadPool* pool_;
  // Of add_extended(): the last step, its rows as the factor has them, and for each a row of out.
  SparseMatrix last_step_;
  std::vector<int> out_row_;
  Rows panel_;
  SparseCholesky::Space space_;
};

}  // namespace dd
