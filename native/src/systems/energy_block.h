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

/// FactorOptions::smallest_pivot for K and for L + L W L, a fraction of the diagonal entry. Safety:
/// refuses pivots that are lost to rounding altogether. The default is too strict for K: on a strip
/// held at one end pivots fall with the cube of its length, and the solution may still be accurate.
constexpr double kSmallestPivotOfK = 1e-17;

/// Degree beyond which a vertex is a hub: its curvature couples all of its neighbours in K, a dense
/// block of that size. A lower value makes more vertices take the low-rank path of EnergyBlock, a
/// higher one costs more fill.
constexpr int kMostNeighbours = 1000;

/// Vertices with more than most_neighbours neighbours that are free or have a free neighbour.
std::vector<int> find_hubs(const SparseMatrix& laplacian, const Region& region,
                           int most_neighbours = kMostNeighbours);

/// L_F: W L_:F, F×F: with W = M⁻¹ the block of K of order 2. weights: the diagonal of W, n.
SparseMatrix weighted_bilaplacian_block(const SparseMatrix& laplacian, const Region& region,
                                        const Eigen::VectorXd& weights);

/// The F×F block of K: sparse + vectors · core · vectorsᵀ. The low-rank term carries the curvature
/// of hubs and is empty without hubs. The sum, and sparse alone, are positive definite wherever K
/// is.
struct EnergyBlock {
  SparseMatrix sparse;
  SparseMatrix vectors;  ///< F×k, one to three columns for each hub
  Eigen::MatrixXd core;  ///< k×k, symmetric, indefinite
};
EnergyBlock energy_block(const SurfaceOperators& operators, const Region& region,
                         Smoothness smoothness, int most_neighbours = kMostNeighbours);

/// K X for four columns, one row at a time: K X = L Y with Y = (M⁻¹ L)^(order − 1) X.
class EnergyProduct {
 public:
  using Scratch = std::array<Rows, 2>;  ///< n×4 buffers, to be kept between products
  /// values: X, n×4. scratch: holds Y. Both and the operators must outlive this. pool: null, or for
  /// this call.
  EnergyProduct(const SurfaceOperators& operators, Smoothness smoothness, const Rows& values,
                Scratch& scratch, ThreadPool* pool);
  Eigen::RowVector4d row(Index vertex) const { return row(*last_, vertex); }

 private:
  /// A row of L times values.
  Eigen::RowVector4d row(const Rows& values, Index vertex) const;
  const SparseMatrix& laplacian_;
  const Rows* last_;  // Y
};

}  // namespace dd
