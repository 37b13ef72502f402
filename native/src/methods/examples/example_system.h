// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/QR>
#include <memory>
#include <vector>

#include "methods/examples/example_pass.h"
#include "methods/examples/example_places.h"

namespace dd {

/// What becomes of a handle's vertices: moved by it, free with their mean placed by it, or free.
enum class HandleHold { whole, mean, none };

/// The Poisson system that poses are solved in. Where no handle is let go it is the one that all
/// methods share, else one of its own. A handle's mean is placed by forces λ that its vertices
/// share out evenly:
///
///   L p' = div(G Tᵀ) + Σ_h a_h λ_h,   a_hᵀ p' = the mean told,   a_h = 1/n at its n vertices
template <class Real>
class ExampleSystem {
 public:
  /// of: outlives it. hold: of each handle.
  ExampleSystem(const ExampleSurface& of, std::vector<HandleHold> hold);

  const std::vector<HandleHold>& hold() const { return hold_; }
  ExamplePass<Real>& pass() { return *pass_; }
  const ExamplePass<Real>& pass() const { return *pass_; }

  /// The handles' displacements, of all rows in the surface's order, which are met from then on.
  void take_handles(const Rows& offsets);
  /// 4 numbers for each handle's vertex, in order.
  const Rows& told() const { return told_; }

  /// Solves by the sections' divergences, as PoissonSystem::solve(): all rows, in its own order.
  template <class Add>
  const Rows& solve(const Add& add) {
    return solve(add, told_);
  }
  /// The same with all of its handles at rest.
  template <class Add>
  const Rows& solve_at_rest(const Add& add) {
    return solve(add, at_rest_);
  }
  /// By the misfit of the pass, the force at each handle's vertex, as told() has them.
  Rows forces() const;

  /// Parts that nothing holds go where the examples' weights take them; then what was solved is put
  /// into the rows of offsets that are free or a handle's, in the surface's order.
  void give(const Eigen::VectorXd& weights, Rows& offsets);

  double bytes() const;

 private:
  struct Placed {
    std::vector<int> rows, told;  // of its vertices: in its order, and in told_
  };
  void make_means();
  void place_means(const Rows& told);
  template <class Add>
  const Rows& solve(const Add& add, const Rows& told) {
    for (size_t i = 0; i < told_rows_.size(); ++i) offsets_.row(told_rows_[i]) = told.row(Index(i));
    poisson_->solve(nothing_, add, offsets_);
    if (!placed_.empty()) place_means(told);
    return offsets_;
  }

  const FactoredSurface& surface_;
  std::vector<HandleHold> hold_;
  Region region_;  // of a system of its own
  std::unique_ptr<PoissonSystem> own_;
  PoissonSystem* poisson_;
  std::unique_ptr<ExamplePass<Real>> pass_;
  std::unique_ptr<ExamplePlaces> places_;
  std::vector<int> told_rows_;  // of the handles' vertices
  Rows told_, at_rest_, offsets_, nothing_;
  std::vector<Placed> placed_;
  RowMatrix responses_;  // y_h of L y = a_h, then 1 on each component that floats
  Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> means_;
};

}  // namespace dd
