// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "base/handle_coordinates.h"
#include "systems/handle_solve.h"
#include "systems/poisson_system.h"

namespace dd {

/// What a bind keeps for the frames of the system K.
enum class KeptOfEnergy {
  cheaper,    ///< K's factor if there are many functions and one solve is exact enough, else W
  functions,  ///< W
  factor      ///< K's factor
};

/// Affine motions of the handles displace the base by a field that is linear in their matrices (§6,
/// after Botsch and Kobbelt 2004):
///
///   δq = W C,   C of HandleCoordinates.
///
/// Each column of W is a basis function: the solution of K w = 0 with the values of one coordinate
/// at the handles' vertices, and zero at all other constrained vertices. With few handles W is
/// kept, and a frame needs no solve for its base. With many, where W would have more than half as
/// many entries as K's factor, the factor is kept instead: a frame solves K δq = 0 with the values
/// that C prescribes at the handles' vertices, and a bind computes no basis functions. A column of
/// W takes one solve if one_solve, else iterative refinement until it converges.
class HandleExtension {
 public:
  HandleExtension() = default;  ///< of no handles
  /// positions: of S. order: of the free vertices. pool must outlive it. one_solve: whether one
  /// solve of K is exact enough without refinement. precision: of the frames.
  /// progress: called with the finished fraction, from 0 to 1. Throws UnsolvableSurface.
  HandleExtension(const PolyharmonicSystem& bending, const HandleCoordinates& coordinates,
                  const Region& region, const Positions& positions, const RowOrder& order,
                  ThreadPool& pool, bool one_solve, Precision precision,
                  KeptOfEnergy kept = KeptOfEnergy::cheaper,
                  const std::function<void(double)>& progress = {});

  bool empty() const { return coordinates_.count() == 0; }
  bool factor_kept() const { return solve_ != nullptr; }
  bool first_half_is_ready() const { return solve_ && solve_->first_half_is_ready(); }
  bool in_single() const { return solve_ && solve_->in_single(); }

  /// The free rows of out become those of rest + δq, rows in order. coefficients: C of all handles,
  /// 4h×4, the last column 0. out may be rest.
  void displace(const RowMatrix& coefficients, const Rows& rest, Rows& out) const;

  /// W, F×coordinates, rows in order; if it is not kept, it is computed into space.
  const RowMatrix& functions(RowMatrix& space) const;

  double bytes() const;

 private:
  template <class Extend>
  RowMatrix extended(const Extend& extend, const std::function<void(double)>& progress) const;
  RowMatrix extended_by(const HandleSolve& solve,
                        const std::function<void(double)>& progress) const;

  HandleCoordinates coordinates_;
  SparseMatrix values_;           // of the coordinates at the handles' vertices
  std::vector<int> row_of_free_;  // in order, of each free vertex as Region has them
  ThreadPool* pool_ = nullptr;
  RowMatrix functions_;                 // W
  std::unique_ptr<HandleSolve> solve_;  // or this
};

}  // namespace dd
