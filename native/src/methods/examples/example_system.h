// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/QR>
#include <memory>
#include <vector>

#include "methods/examples/example_pass.h"
#include "methods/examples/example_places.h"

namespace dd {

/// How a handle constrains its vertices: all positions, only their mean position, or not at all.
enum class HandleHold { whole, mean, none };

/// The Poisson system for the positions of a pose. If all handles are HandleHold::whole, it is the
/// one that all methods share, else a system of its own in which the vertices of other handles are
/// free. The mean m_h of a handle is prescribed with Lagrange multipliers λ_h:
///
///   L p' = div(G Tᵀ) + Σ_h a_h λ_h,   a_hᵀ p' = m_h,   a_h = 1/n at the handle's n vertices
template <class Real>
class ExampleSystem {
 public:
  /// of must outlive this. hold: for each handle.
  ExampleSystem(const ExampleSurface& of, std::vector<HandleHold> hold);

  const std::vector<HandleHold>& hold() const { return hold_; }
  ExamplePass<Real>& pass() { return *pass_; }
  const ExamplePass<Real>& pass() const { return *pass_; }

  /// Sets the displacements of the handles' vertices. offsets: all rows, in the surface's order.
  void take_handles(const Rows& offsets);
  /// These displacements, a row for each of Region::handle_vertices.
  const Rows& told() const { return told_; }

  /// Solves for the displacement; add as for PoissonSystem::solve(). Returns all rows, in the order
  /// of this system. Valid until the next solve.
  template <class Add>
  const Rows& solve(const Add& add) {
    return solve(add, told_);
  }
  /// The same with all handles at rest.
  template <class Add>
  const Rows& solve_at_rest(const Add& add) {
    return solve(add, at_rest_);
  }
  /// The divergence of the pass's residual at the handles' vertices, rows as told().
  Rows forces() const;

  /// Places components without constrained vertices (ExamplePlaces) and copies the solution to the
  /// rows of free and handle vertices of offsets, in the surface's order.
  void give(const Eigen::VectorXd& weights, Rows& offsets);

  double bytes() const;

 private:
  struct Placed {
    std::vector<int> rows, told;  // of the handle's vertices: rows in own order, rows in told_
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
  Region region_;  // of own_
  std::unique_ptr<PoissonSystem> own_;
  PoissonSystem* poisson_;
  std::unique_ptr<ExamplePass<Real>> pass_;
  std::unique_ptr<ExamplePlaces> places_;
  std::vector<int> told_rows_;  // row in own order of each of Region::handle_vertices
  Rows told_, at_rest_, offsets_, nothing_;
  std::vector<Placed> placed_;
  RowMatrix responses_;  // columns: y_h with L y_h = a_h, then for each floating component 1 on it
  Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> means_;
};

}  // namespace dd
