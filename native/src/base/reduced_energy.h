// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "base/bound_surface.h"

namespace dd {

/// The as-rigid-as-possible energy of the base in the subspace of the basis functions W (after
/// Jacobson and others 2012, Fast automatic skinning transformations):
///
///   E(A, R) = Σ_k Σ_{j∈k} A_j ‖G_j(q + W C) − G_j(q) R_kᵀ‖²
///
/// with one rotation R_k for each cluster k of triangles, see RotationClusters. A step of the
/// minimization costs the clusters' rotations and products with small matrices, independent of the
/// mesh's size.
///
/// Where limbs are solid, clusters are of vertices, sections of limbs among them, and the energy is
/// a sum over their edges (i, j) with the weights of L, ½ w_ij ‖(q_i − q_j)' − R_k (q_i − q_j)‖²,
/// which on a symmetric limb is symmetric, however its faces are divided into triangles.
class ReducedEnergy {
 public:
  using Affine = Eigen::Matrix<double, 3, 4>;

  /// free: for each handle, whether its linear part is an unknown. limbs: how solid the surface is
  /// at each vertex, 0 to 1; empty: it isn't. bound must outlive this.
  ReducedEnergy(const BoundSurface& bound, std::vector<char> free, const Eigen::VectorXd& limbs);

  /// The handles that are free; the order of what the functions below return.
  const std::vector<int>& free_handles() const { return free_handles_; }

  /// Minimizes E over the linear parts of the free handles and all R_k by local and global steps.
  /// Returns the rotation of the cluster around each free handle. motions: of all handles; a free
  /// handle's moves only its pivot. pivots: h×3, at rest. initial: linear parts to begin with. Not
  /// for a base from outside.
  std::vector<Eigen::Matrix3d> minimize(const std::vector<Affine>& motions, const Positions& pivots,
                                        const std::vector<Eigen::Matrix3d>& initial) const;

  /// For each free handle the rotation R_k that fits the deformation of the cluster around it best.
  /// base: B', in order().
  std::vector<Eigen::Matrix3d> rotations_of(const Rows& base) const;

  double bytes() const;

 private:
  struct Problem;
  void gather_triangles(const RowMatrix& basis_functions);
  void gather_spokes(const Eigen::VectorXd& limbs, const RowMatrix& basis_functions);
  /// rest: q of all vertices. flux(k, add): calls add(vertex, flux) for cluster k, any number of
  /// times for each vertex.
  template <class Flux>
  void gather_covariances(int count, const Positions& rest, const RowMatrix& basis_functions,
                          const Flux& flux);
  void gather_energy_rows(const RowMatrix& basis_functions);
  Problem set_up(const std::vector<Affine>& motions, const Positions& pivots) const;
  void assemble(const std::vector<Eigen::Matrix3d>& initial, Problem& problem) const;

  const BoundSurface& bound_;
  std::vector<char> free_;
  std::vector<int> free_handles_;
  int cluster_count_ = 0;
  RowMatrix energy_rows_;  // the rows of Wᵀ L W for coordinates of free handles
  // Three rows for each cluster: its covariance at rest, Σ_j div(G_j) q, and what each coordinate
  // of a handle adds, Σ_j div(G_j) W.
  RowMatrix rest_covariance_, covariance_basis_;
  struct Corner {
    int row;  // in order()
    Eigen::Vector3d flux;
  };
  std::vector<std::vector<Corner>> cluster_corners_;  // of the cluster around each free handle
};

}  // namespace dd
