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
  void prescribe_handles(const Rows& offsets);
  /// These displacements, a row for each of Region::handle_vertices.
  const Rows& prescribed() const { return prescribed_; }

  /// Solves for the displacement; add as for PoissonSystem::solve(). Returns all rows, in the order
  /// of this system. Valid until the next solve.
  template <class Add>
  const Rows& solve(const Add& add) {
    return solve(add, prescribed_);
  }
  /// The same with all handles at rest.
  template <class Add>
  const Rows& solve_at_rest(const Add& add) {
    return solve(add, at_rest_);
  }
  /// The divergence of the pass's residual at the handles' vertices, rows as prescribed().
  Rows forces() const;

  /// Places components without constrained vertices (ExamplePlaces) and copies the solution to the
  /// rows of free and handle vertices of offsets, in the surface's order.
  void write_pose(const Eigen::VectorXd& weights, Rows& offsets);

  double bytes() const;

 private:
  struct MeanHandle {
    std::vector<int> rows;        // of the handle's vertices, in own order
    std::vector<int> prescribed;  // the same vertices' rows in prescribed_
  };
  void find_mean_handles();
  /// A component that only means hold is floating: L is singular there. Its translation is a
  /// further unknown, with the equation that the forces on it sum to zero.
  void find_floating_components();
  /// The force of a mean on a vertex: the row of the right-hand side and the handle.
  struct HandleForce {
    int target, handle;
  };
  /// The forces of all means, by section. Each vertex' force is added once, by the first section
  /// with an active triangle at the vertex.
  std::vector<std::vector<HandleForce>> handle_forces() const;
  void solve_for_responses();
  void factor_mean_constraints();
  void enforce_means(const Rows& prescribed);
  template <class Add>
  const Rows& solve(const Add& add, const Rows& prescribed) {
    for (size_t i = 0; i < prescribed_rows_.size(); ++i)
      offsets_.row(prescribed_rows_[i]) = prescribed.row(Index(i));
    poisson_->solve(zero_divergence_, add, offsets_);
    if (!mean_handles_.empty()) enforce_means(prescribed);
    return offsets_;
  }

  const FactoredSurface& surface_;
  std::vector<HandleHold> hold_;
  Region region_;  // of own_poisson_
  std::unique_ptr<PoissonSystem> own_poisson_;
  PoissonSystem* poisson_;
  std::unique_ptr<ExamplePass<Real>> pass_;
  std::unique_ptr<ExamplePlaces> places_;
  std::vector<int> prescribed_rows_;  // row in own order of each of Region::handle_vertices
  Rows prescribed_, at_rest_, offsets_, zero_divergence_;
  std::vector<MeanHandle> mean_handles_;
  // Columns: y_h with L y_h = a_h, then for each floating component 1 on it.
  RowMatrix constraint_responses_;
  Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> mean_constraints_;
};

}  // namespace dd
