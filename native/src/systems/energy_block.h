// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "support/thread_pool.h"
#include "systems/operators.h"
#include "systems/region.h"

namespace dd {

/// The energy whose minimizer is the base surface: K = L (M⁻¹ L)^(order − 1).
enum class Smoothness {
  membrane = 1,            ///< least area: continuous at the border
  thin_plate = 2,          ///< least curvature: tangents continuous, the paper's choice
  curvature_variation = 3  ///< least variation of curvature: curvature continuous
};

/// For FactorOptions::smallest_pivot: K of a long strip that is held at one end has tiny pivots and
/// may be sound.
constexpr double kSmallestOfK = 1e-17;

/// Beyond it a vertex is a hub, whose curvature would couple each of its neighbours with all others
/// in K: a full matrix of that size.
constexpr int kMostNeighbours = 1000;

/// Vertices of more neighbours, where a free vertex is among these and the vertex itself.
std::vector<int> find_hubs(const SparseMatrix& laplacian, const Region& region,
                           int most_neighbours = kMostNeighbours);

/// L_F: W L_:F, F×F: with W = M⁻¹ the block of K of order 2. weights: the diagonal of W, n.
SparseMatrix bending_block(const SparseMatrix& laplacian, const Region& region,
                           const Eigen::VectorXd& weights);

/// The F×F block of K that belongs to free vertices: sparse + vectors · core · vectorsᵀ, positive
/// definite wherever K is, and so is its sparse part. Without hubs that is all.
struct EnergyBlock {
  SparseMatrix sparse;
  SparseMatrix vectors;  ///< F×k, two or three for each hub
  Eigen::MatrixXd core;  ///< k×k, symmetric, indefinite
};
EnergyBlock energy_block(const SurfaceOperators& operators, const Region& region,
                         Smoothness smoothness, int most_neighbours = kMostNeighbours);

/// K X for four columns, row by row: K = L Y with Y = (M⁻¹ L)^(order − 1) X.
class EnergyProduct {
 public:
  using Space = std::array<Rows, 2>;  ///< n×4 each, which may be kept
  /// values: X, n×4. space: for Y. These and the operators must outlive it. pool: null, or shares
  /// the work.
  EnergyProduct(const SurfaceOperators& operators, Smoothness smoothness, const Rows& values,
                Space& space, ThreadPool* pool);
  Eigen::RowVector4d row(Index vertex) const { return row(*last_, vertex); }

 private:
  /// Of L times values.
  Eigen::RowVector4d row(const Rows& values, Index vertex) const;
  const SparseMatrix& laplacian_;
  const Rows* last_;  // Y
};

}  // namespace dd
