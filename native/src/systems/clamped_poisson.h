// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "systems/poisson_system.h"

namespace dd {

/// Beyond the paper: (14) holds places alone, so whatever the gradients can't integrate to spreads
/// harmonically, and the surface meets every rim with a crease that stays however fine the mesh is.
/// Here the mismatch of the second order counts too, and with it the slope is held at rims, as that
/// of a clamped plate is:
///
///   (L + L W L) p' = (1 + L W) div(S),   W = a M⁻¹
///
/// on the free vertices. √a is 1.5 lengths at rims and falls evenly, to none at 2.5 lengths over
/// the surface: farther in there is nothing to hold, and a factor of L² has three times the entries
/// of one of L. Solved for corrections to what is at hand, from its residual r = div(S) − L p' at
/// free vertices and rims:  (L + L W L) Δ = (1 + L W) r.
class ClampedPoisson {
 public:
  /// length: in the mesh's units. poisson: of these operators and region; it must outlive this, and
  /// its threads and precision are taken over. A factor in single precision is kept where it solves
  /// well enough, with corrections. dissection: of the free vertices. Throws UnsolvableSurface.
  ClampedPoisson(const Mesh& mesh, const Region& region, const SurfaceOperators& operators,
                 PoissonSystem& poisson, const Dissection& dissection, double length);

  double length() const { return length_; }

  /// As PoissonSystem::solve().
  template <class Add>
  void solve(const Rows& at_rest, const Add& add, Rows& offsets) {
    const Rows& divergence = poisson_.divergence(at_rest, add);
    offsets.topRows(poisson_.order().free_count).setZero();
    correct(divergence, offsets, From::rest);
    for (int round = 0; round < corrections_; ++round) correct(divergence, offsets, From::anywhere);
  }

  /// The same from the present offsets.
  template <class Add>
  void step(const Rows& at_rest, const Add& add, Rows& offsets) {
    correct(poisson_.divergence(at_rest, add), offsets, From::anywhere);
  }

  double bytes() const;

 private:
  /// Where free vertices are: at rest only those beside a constrained one have an L p' to look at.
  enum class From { rest, anywhere };
  void correct(const Rows& divergence, Rows& offsets, From from);
  double solving_error(const SparseMatrix& block, const Rows& smooth);

  PoissonSystem& poisson_;
  double length_;
  std::unique_ptr<SparseCholesky> factor_;
  int corrections_ = 0;
  std::vector<int> row_of_place_;  // of the factor, in the Poisson system's order
  /// Of the active triangles: free vertices, then rims; columns are rows of the order.
  Eigen::SparseMatrix<double, Eigen::RowMajor> laplacian_;
  Eigen::VectorXd weights_;      // of the same: the diagonal of W
  std::vector<char> near_rims_;  // of free rows: whether W reaches them or a neighbour
  std::vector<char> at_rims_;    // the same: whether a neighbour is constrained
  Rows residual_, scaled_;
  Rows right_;  // in the factor's order
  SparseCholesky::Space space_;
};

}  // namespace dd
