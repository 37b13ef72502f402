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
  /// pool: null, or outlives it.
  HandleSolve(const PolyharmonicSystem& bending, const Region& region, ThreadPool* pool);

  /// values: a row for each of Region::handle_vertices. Returns F×k, rows as in Region::free.
  RowMatrix extend(const RowMatrix& values) const;

  /// The same of three columns, for a frame: out = rest + what it returns, in the rows that
  /// row_of_free says for each of Region::free. values: the fourth column 0.
  void add_extended(const Rows& values, const std::vector<int>& row_of_free, const Rows& rest,
                    Rows& out);

  double bytes() const;

 private:
  /// −K_FC times values.
  template <class Values>
  Values force(Values values) const;

  std::shared_ptr<const UpdatedCholesky> factor_;
  // −K_FC = −L_FT M⁻¹ L_TC and the like: from the handles' vertices outwards, an L at a time, where
  // free vertices can feel it. One matrix of them all would be full around a hub.
  std::vector<SparseMatrix> steps_;
  ThreadPool* pool_;
  // Of add_extended().
  Rows panel_;
  SparseCholesky::Space space_;
};

}  // namespace dd
