// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "systems/poisson_system.h"

namespace dd {

/// L of the active triangles at rims: a row for each of PoissonSystem::rims(), columns in its
/// order.
Eigen::SparseMatrix<double, Eigen::RowMajor> rim_laplacian(const SurfaceOperators& operators,
                                                           const PoissonSystem& poisson);

/// The square of the length over which ClampedPoisson holds the slope, a, of every vertex: 1.5
/// lengths at rims, 0 from a distance of 2.5 lengths over the surface on.
Eigen::VectorXd clamped_squares(const Mesh& mesh, const SurfaceOperators& operators,
                                const PoissonSystem& poisson, double length);

/// Beyond the paper: (14) prescribes positions only. So the part of the gradients that is not
/// integrable spreads harmonically, and the surface meets every rim with a crease that does not
/// shrink with the edge length. This system counts the second-order mismatch too, which holds the
/// slope at rims like that of a clamped plate:
///
///   (L + L W L) p' = (1 + L W) div(S),   W = a M⁻¹
///
/// on the free vertices. √a is 1.5 lengths at rims and falls linearly to 0 at a distance of 2.5
/// lengths over the surface. Farther in there is no slope to hold, and a factor of L² has three
/// times the entries of one of L. It is solved for corrections of the present displacement, from
/// the residual r = div(S) − L p' at free vertices and rims: (L + L W L) Δ = (1 + L W) r.
class ClampedPoisson {
 public:
  /// length: in the mesh's units. poisson: made from the same operators and region; must outlive
  /// this; its threads and precision are used. A single-precision factor is kept if it is accurate
  /// enough, if need be with corrections. dissection: of the free vertices. Throws
  /// UnsolvableSurface.
  ClampedPoisson(const Mesh& mesh, const Region& region, const SurfaceOperators& operators,
                 PoissonSystem& poisson, const Dissection& dissection, double length);
  /// The same with given squares a, n, and masses M, n.
  ClampedPoisson(const Mesh& mesh, const Region& region, const SurfaceOperators& operators,
                 PoissonSystem& poisson, const Dissection& dissection, double length,
                 const Eigen::VectorXd& squares, const Eigen::VectorXd& masses);

  double length() const { return length_; }

  /// As PoissonSystem::solve() with relaxation 1.
  template <class Add>
  void solve(const Rows& at_rest, const Add& add, Rows& offsets) {
    const Rows& divergence = poisson_.divergence(at_rest, add);
    offsets.topRows(poisson_.order().free_count).setZero();
    correct(divergence, offsets, Start::zero);
    for (int round = 0; round < corrections_; ++round) correct(divergence, offsets, Start::current);
  }

  /// One correction of the present offsets.
  template <class Add>
  void step(const Rows& at_rest, const Add& add, Rows& offsets) {
    correct(poisson_.divergence(at_rest, add), offsets, Start::current);
  }

  /// What a mismatch of (14) at rims displaces, (L + L W L) δ = L_:C W s. rims: s, a row for each
  /// of PoissonSystem::rims(). offsets: δ in its order.
  void displace(const Rows& rims, Rows& offsets);

  double bytes() const;

 private:
  /// State of the free rows of offsets. At rest they are zero, and L p' vanishes except at rims and
  /// their free neighbours.
  enum class Start { zero, current };
  void correct(const Rows& divergence, Rows& offsets, Start start);
  double solving_error(const SparseMatrix& block, const Rows& smooth);

  PoissonSystem& poisson_;
  double length_;
  std::unique_ptr<SparseCholesky> factor_;
  int corrections_ = 0;
  std::vector<int> row_of_index_;  // index of the factor → row in the Poisson system's order
  /// L of the active triangles. Rows: free vertices, then rims; columns: the Poisson system's
  /// order.
  Eigen::SparseMatrix<double, Eigen::RowMajor> laplacian_;
  Eigen::VectorXd weights_;      // by row of laplacian_: the diagonal of W
  std::vector<char> near_rims_;  // by free row: whether W is non-zero at it or a neighbour
  std::vector<char> at_rims_;    // by free row: whether it has a constrained neighbour
  Rows residual_, scaled_;
  Rows right_;  // in the factor's order
  SparseCholesky::SolveScratch scratch_;
};

}  // namespace dd
