// SPDX-License-Identifier: GPL-3.0-or-later
#include "systems/clamped_poisson.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "mesh/geodesic_distances.h"
#include "systems/energy_block.h"

namespace dd {

namespace {

// √a at rims and the distance at which it has fallen to 0, both in lengths. Larger values hold the
// slope farther in and cost entries of the factor.
constexpr double kRimStiffness = 1.5, kRimWidth = 2.5;
// Errors of a single-precision solve for a solution as large as the mesh, in a box of diagonal 1.
// Up to kAcceptedError, the limit of PoissonSystem, it is used as it is. Below kCorrectableError at
// most three corrections follow, each of which is expected to reduce the error by that factor. Else
// the factor is kept in double precision.
constexpr double kAcceptedError = 3e-6, kCorrectableError = 0.02;

/// The diagonal of W, n.
Eigen::VectorXd slope_weights(const Region& region, const SparseMatrix& laplacian,
                              const Eigen::VectorXd& squares, const Eigen::VectorXd& masses) {
  Eigen::VectorXd weights = Eigen::VectorXd::Zero(squares.size());
  for (Index v = 0; v < weights.size(); ++v)
    if (squares[v] > 0) weights[v] = squares[v] / masses[v];
  for (int hub : find_hubs(laplacian, region)) weights[hub] = 0;
  return weights;
}

/// L of the active triangles. Rows: free vertices, then rims; columns: the Poisson system's order.
Eigen::SparseMatrix<double, Eigen::RowMajor> active_laplacian(const SurfaceOperators& operators,
                                                              const PoissonSystem& poisson) {
  const RowOrder& order = poisson.order();
  const SparseMatrix& whole = operators.laplacian;
  const Eigen::SparseMatrix<double, Eigen::RowMajor> of_rims = rim_laplacian(operators, poisson);
  Eigen::SparseMatrix<double, Eigen::RowMajor> laplacian(poisson.active_vertex_count(),
                                                         order.count());
  laplacian.reserve(whole.nonZeros());
  for (int r = 0; r < order.free_count; ++r) {
    laplacian.startVec(r);
    for (SparseMatrix::InnerIterator it(whole, order.vertex_of_row[r]); it; ++it)
      laplacian.insertBackByOuterInnerUnordered(r, order.row_of_vertex[it.row()]) = it.value();
  }
  for (Index i = 0; i < of_rims.rows(); ++i) {
    laplacian.startVec(order.free_count + i);
    for (decltype(laplacian)::InnerIterator it(of_rims, i); it; ++it)
      laplacian.insertBackByOuterInnerUnordered(order.free_count + i, it.col()) = it.value();
  }
  laplacian.finalize();
  return laplacian;
}

}  // namespace

Eigen::SparseMatrix<double, Eigen::RowMajor> rim_laplacian(const SurfaceOperators& operators,
                                                           const PoissonSystem& poisson) {
  const Triangles& t = operators.triangles;
  const RowOrder& order = poisson.order();
  const std::vector<int>& rims = poisson.rims();
  using Entries = std::map<int, double>;
  std::vector<Entries> of_rims(rims.size());
  const auto add = [&](int at, int other, double weight) {
    const int row = order.row_of_vertex[at];
    if (row < order.free_count) return;
    Entries& entries = of_rims[poisson.active_index(row) - order.free_count];
    entries[row] += weight;
    entries[order.row_of_vertex[other]] -= weight;
  };
  for (int j : poisson.active().triangles)
    for (int k = 0; k < 3; ++k) {
      const int a = t(j, (k + 1) % 3), b = t(j, (k + 2) % 3);
      const double weight = 0.5 * operators.metric.cotangents(j, k);
      add(a, b, weight);
      add(b, a, weight);
    }
  Eigen::SparseMatrix<double, Eigen::RowMajor> laplacian(static_cast<Index>(rims.size()),
                                                         order.count());
  for (size_t i = 0; i < rims.size(); ++i) {
    laplacian.startVec(Index(i));
    for (const auto& [column, value] : of_rims[i])
      laplacian.insertBackByOuterInnerUnordered(Index(i), column) = value;
  }
  laplacian.finalize();
  return laplacian;
}

Eigen::VectorXd clamped_squares(const Mesh& mesh, const SurfaceOperators& operators,
                                const PoissonSystem& poisson, double length) {
  std::vector<char> is_rim(size_t(mesh.vertex_count()), 0);
  for (int row : poisson.rims()) is_rim[poisson.order().vertex_of_row[row]] = 1;
  const double reach = kRimWidth * length;
  // Fast marching loses accuracy at obtuse corners, so it uses the flipped triangles as well.
  const std::vector<double> distance =
      operators.flipped ? geodesic_distances({mesh.positions, operators.triangles}, is_rim, reach)
                        : geodesic_distances(mesh, is_rim, reach);
  Eigen::VectorXd squares = Eigen::VectorXd::Zero(mesh.vertex_count());
  for (int v = 0; v < mesh.vertex_count(); ++v) {
    const double size = kRimStiffness * length * (1 - distance[v] / reach);
    if (size > 0) squares[v] = size * size;
  }
  return squares;
}

ClampedPoisson::ClampedPoisson(const Mesh& mesh, const Region& region,
                               const SurfaceOperators& operators, PoissonSystem& poisson,
                               const Dissection& dissection, double length)
    : ClampedPoisson(mesh, region, operators, poisson, dissection, length,
                     clamped_squares(mesh, operators, poisson, length), operators.masses) {}

ClampedPoisson::ClampedPoisson(const Mesh& mesh, const Region& region,
                               const SurfaceOperators& operators, PoissonSystem& poisson,
                               const Dissection& dissection, double length,
                               const Eigen::VectorXd& squares, const Eigen::VectorXd& masses)
    : poisson_(poisson), length_(length) {
  const RowOrder& order = poisson.order();
  const int free_count = order.free_count;
  const int active_rows = poisson.active_vertex_count();

  const Eigen::VectorXd weights = slope_weights(region, operators.laplacian, squares, masses);
  SparseMatrix block = weighted_bilaplacian_block(operators.laplacian, region, weights);
  block += free_block(operators.laplacian, region);
  ground(block, region);
  BlockOptions options;
  options.precision = poisson.precision();
  options.pool = &poisson.pool();
  options.smallest_pivot = kSmallestPivotOfK;
  options.dissection = &dissection;
  factor_ = std::make_unique<SparseCholesky>(factor_free_block(block, region, options));
  options.symbolic = factor_->shared_symbolic();

  for (int r : factor_->order()) row_of_index_.push_back(order.row_of_vertex[region.free[r]]);
  weights_.resize(active_rows);
  for (int i = 0; i < active_rows; ++i) weights_[i] = weights[poisson.active_vertex(i)];
  laplacian_ = active_laplacian(operators, poisson);
  near_rims_.assign(static_cast<size_t>(free_count), 0);
  at_rims_ = near_rims_;
  for (int r = 0; r < free_count; ++r)
    for (decltype(laplacian_)::InnerIterator it(laplacian_, r); it; ++it) {
      near_rims_[r] |= weights[order.vertex_of_row[it.col()]] != 0;
      at_rims_[r] |= it.col() >= free_count;
    }

  residual_ = Rows::Zero(active_rows, 4);
  scaled_ = Rows::Zero(order.count(), 4);
  right_ = Rows::Zero(factor_->symbolic().slotted_size(), 4);
  if (options.precision == Precision::full) return;
  // Test solution: the rest positions, as large and as smooth as a frame's solution.
  Rows smooth(free_count, 4);
  for (int r = 0; r < free_count; ++r)
    smooth.row(r) << mesh.positions.row(order.vertex_of_row[r]), 0;
  const double error = solving_error(block, smooth);
  if (error <= kAcceptedError) return;
  if (error < kCorrectableError) {
    for (double left = error; left > kAcceptedError; left *= error) ++corrections_;
    return;
  }
  options.precision = Precision::full;
  factor_ = std::make_unique<SparseCholesky>(factor_free_block(block, region, options));
}

double ClampedPoisson::solving_error(const SparseMatrix& block, const Rows& smooth) {
  Rows in_block_order(smooth.rows(), 4);
  const std::vector<int>& order = factor_->order();
  for (Index k = 0; k < smooth.rows(); ++k)
    in_block_order.row(order[k]) = smooth.row(row_of_index_[k]);
  const Rows right = block * in_block_order;
  for (Index k = 0; k < smooth.rows(); ++k) right_.row(k) = right.row(order[k]);
  double error = 0;
  factor_->solve_in_order(
      right_.data(), scratch_, nullptr, [](int) {},
      [&](int begin, int end, const auto* x) {
        for (int k = begin; k < end; ++k, x += 4)
          for (int c = 0; c < 3; ++c)
            error = std::max(error, std::abs(double(x[c]) - smooth(row_of_index_[k], c)));
      });
  return std::isfinite(error) ? error : 1;
}

void ClampedPoisson::correct(const Rows& divergence, Rows& offsets, Start start) {
  const int free_count = poisson_.order().free_count;
  ThreadPool& pool = poisson_.pool();
  pool.parallel_for(residual_.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      const bool free = i < free_count;
      Eigen::RowVector4d row = divergence.row(free ? i : poisson_.rim_begin() + (i - free_count));
      if (start == Start::current || !free || at_rims_[i])
        for (decltype(laplacian_)::InnerIterator it(laplacian_, i); it; ++it)
          row -= it.value() * offsets.row(it.col());
      residual_.row(i) = row;
      if (weights_[i] != 0)
        scaled_.row(poisson_.active_row(static_cast<int>(i))) = weights_[i] * row;
    }
  });
  pool.parallel_for(free_count, kLeastRange, [&](int64_t begin, int64_t end) {
    for (int64_t k = begin; k < end; ++k) {
      const int i = row_of_index_[size_t(k)];
      Eigen::RowVector4d sum = residual_.row(i);
      if (near_rims_[i])
        for (decltype(laplacian_)::InnerIterator it(laplacian_, i); it; ++it)
          sum += it.value() * scaled_.row(it.col());
      right_.row(k) = sum;
    }
  });
  factor_->solve_in_order(
      right_.data(), scratch_, &pool, [](int) {},
      [&](int begin, int end, const auto* x) {
        for (int k = begin; k < end; ++k, x += 4) {
          double* row = offsets.data() + 4 * Index(row_of_index_[k]);
          for (int c = 0; c < 3; ++c) row[c] += static_cast<double>(x[c]);
        }
      });
}

void ClampedPoisson::displace(const Rows& rims, Rows& offsets) {
  Rows divergence = Rows::Zero(poisson_.right_hand_side_rows(), 4);
  divergence.middleRows(poisson_.rim_begin(), rims.rows()) = rims;
  offsets.setZero(poisson_.order().count(), 4);
  correct(divergence, offsets, Start::zero);
  for (int round = 0; round < corrections_; ++round) correct(divergence, offsets, Start::current);
}

double ClampedPoisson::bytes() const {
  return factor_->bytes() + static_cast<double>(near_rims_.size() + at_rims_.size()) +
         static_cast<double>(laplacian_.nonZeros()) * (sizeof(double) + sizeof(int)) +
         static_cast<double>((residual_.size() + scaled_.size() + right_.size() + weights_.size()) *
                             Index(sizeof(double))) +
         static_cast<double>(row_of_index_.size() * sizeof(int) +
                             scratch_.single.size() * sizeof(float) +
                             scratch_.full.size() * sizeof(double));
}

}  // namespace dd
