// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "base/handle_coordinates.h"
#include "systems/handle_solve.h"
#include "systems/poisson_system.h"

namespace dd {

class MixedBilaplacian;

/// What a bind keeps so that frames can solve K δq = 0.
enum class KeptOfEnergy {
  cheaper,  ///< K's factor if W is larger than half of it and one solve is exact enough, else W
  basis_functions,  ///< W
  factor            ///< K's factor
};

struct HandleExtensionOptions {
  ThreadPool* pool = nullptr;  ///< not null; must outlive the extension
  /// Whether a column of W takes one solve of K; else iterative refinement runs until it converges.
  bool single_solve = false;
  Precision precision = Precision::full;  ///< of the frames
  KeptOfEnergy kept = KeptOfEnergy::cheaper;
  std::function<void(double)> progress = {};  ///< called with the finished fraction, from 0 to 1
};

/// The displacement of the base, which is linear in the handles' affine matrices (§6, after Botsch
/// and Kobbelt 2004):
///
///   δq = W C,   C of HandleCoordinates.
///
/// Each column of W is a basis function: the solution of K w = 0 with one handle coordinate as
/// boundary values at the handle's vertices and zero at all other constrained ones. With few
/// handles W is kept, and a frame needs no solve for its base. If W would have more than half as
/// many entries as K's factor, the factor is kept instead, and a bind computes no basis functions.
/// Then a frame solves K δq = 0 with the displacements that C prescribes at the handles' vertices.
class HandleExtension {
 public:
  HandleExtension() = default;  ///< without handles
  /// positions: S. order: row order of the displacements. Throws UnsolvableSurface.
  HandleExtension(const PolyharmonicSystem& bending, const HandleCoordinates& coordinates,
                  const Region& region, const Positions& positions, const RowOrder& order,
                  const HandleExtensionOptions& options);

  /// The same by W, found by another solver of K. bending: outlives the constructor only.
  HandleExtension(MixedBilaplacian& bending, const HandleCoordinates& coordinates,
                  const Region& region, const Positions& positions, const RowOrder& order,
                  const HandleExtensionOptions& options);

  bool empty() const { return coordinates_.count() == 0; }
  bool factor_kept() const { return solve_ != nullptr; }
  bool has_precomputed_forward() const { return solve_ && solve_->has_precomputed_forward(); }
  bool in_single() const { return solve_ && solve_->in_single(); }

  /// Sets the free rows of out to those of rest + δq. coefficients: C of all handles, 4h×4, its
  /// last column 0. out may be rest.
  void displace(const RowMatrix& coefficients, const Rows& rest, Rows& out) const;

  /// W, F×coordinates, rows in order. If W is not kept, it is computed into space.
  const RowMatrix& basis_functions(RowMatrix& space) const;

  double bytes() const;

 private:
  HandleExtension(const HandleCoordinates& coordinates, const Region& region,
                  const Positions& positions, const RowOrder& order, ThreadPool* pool);
  template <class Extend>
  RowMatrix extended(const Extend& extend, const std::function<void(double)>& progress) const;
  RowMatrix extended_by(const HandleSolve& solve,
                        const std::function<void(double)>& progress) const;

  HandleCoordinates coordinates_;
  SparseMatrix coordinate_values_;  // the coordinates of the handles' vertices
  std::vector<int> row_of_free_;    // row in the order of each of Region::free
  ThreadPool* pool_ = nullptr;
  RowMatrix basis_functions_;           // W, or empty if solve_
  std::unique_ptr<HandleSolve> solve_;  // with K's factor, or null
};

}  // namespace dd
