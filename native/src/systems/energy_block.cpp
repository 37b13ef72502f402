// SPDX-License-Identifier: GPL-3.0-or-later
#include "systems/energy_block.h"

#include "systems/free_block.h"

namespace dd {

namespace {

/// The given rows of a matrix, as columns.
SparseMatrix rows_of(const SparseMatrix& matrix, const std::vector<int>& rows) {
  SparseMatrix selection(matrix.rows(), static_cast<Index>(rows.size()));
  for (size_t i = 0; i < rows.size(); ++i) selection.insert(rows[i], static_cast<Index>(i)) = 1;
  return matrix.transpose() * selection;
}

void remove_rows(SparseMatrix& matrix, const std::vector<int>& rows) {
  std::vector<char> removed(static_cast<size_t>(matrix.rows()), 0);
  for (int r : rows) removed[r] = 1;
  matrix.prune([&](Index row, Index, double) { return !removed[row]; });
}

/// Appends columns to vectors, and as many zero rows and columns to core.
void append(EnergyBlock& block, const SparseMatrix& columns) {
  SparseMatrix vectors(columns.rows(), block.vectors.cols() + columns.cols());
  vectors.leftCols(block.vectors.cols()) = block.vectors;
  vectors.rightCols(columns.cols()) = columns;
  block.vectors = std::move(vectors);
  block.core.conservativeResizeLike(
      Eigen::MatrixXd::Zero(block.vectors.cols(), block.vectors.cols()));
}

/// Without the curvature of several hubs the sparse part could be singular. So the diagonal entry
/// of each free hub is doubled there, and a vector of the low-rank term subtracts the addition.
void pin(const std::vector<int>& hubs, const Region& region, EnergyBlock& block) {
  for (int hub : hubs) {
    const int row = region.row[hub];
    if (row < 0) continue;
    SparseMatrix unit(region.free_count(), 1);
    unit.insert(row, 0) = 1;
    append(block, unit);
    double& entry = block.sparse.coeffRef(row, row);
    block.core(block.core.rows() - 1, block.core.rows() - 1) = -entry;
    entry *= 2;
  }
}

}  // namespace

std::vector<int> find_hubs(const SparseMatrix& laplacian, const Region& region,
                           int most_neighbours) {
  std::vector<int> hubs;
  for (int v = 0; v < static_cast<int>(laplacian.cols()); ++v) {
    if (laplacian.col(v).nonZeros() - 1 <= most_neighbours) continue;
    for (SparseMatrix::InnerIterator it(laplacian, v); it; ++it) {
      if (region.row[it.row()] < 0) continue;
      hubs.push_back(v);
      break;
    }
  }
  return hubs;
}

SparseMatrix weighted_bilaplacian_block(const SparseMatrix& laplacian, const Region& region,
                                        const Eigen::VectorXd& weights) {
  SparseMatrix columns = free_columns(laplacian, region);
  columns.prune([&](Index row, Index, double) { return weights[row] != 0; });
  const SparseMatrix weighted = weights.asDiagonal() * columns;
  return columns.transpose() * weighted;
}

// With C = M⁻¹ L_:F, K is L_:Fᵀ C (order 2) or Cᵀ L C (order 3). The hubs' rows are removed from C
// and return in the low-rank term: C = C₀ + E cᵀ, E the hubs' unit vectors and cᵀ their rows.
EnergyBlock energy_block(const SurfaceOperators& operators, const Region& region,
                         Smoothness smoothness, int most_neighbours) {
  if (smoothness == Smoothness::membrane) return {free_block(operators.laplacian, region), {}, {}};
  const std::vector<int> hubs = find_hubs(operators.laplacian, region, most_neighbours);
  const Index count = static_cast<Index>(hubs.size());
  SparseMatrix columns = free_columns(operators.laplacian, region);
  // Evaluated first: within the product Eigen would invert all masses once per column.
  const Eigen::VectorXd inverse_masses = operators.masses.cwiseInverse();
  SparseMatrix curvature = inverse_masses.asDiagonal() * columns;
  EnergyBlock block;
  if (count > 0) {
    append(block, rows_of(curvature, hubs));
    remove_rows(columns, hubs);
    remove_rows(curvature, hubs);
  }
  if (smoothness == Smoothness::thin_plate) {
    block.sparse = columns.transpose() * curvature;
    for (Index i = 0; i < count; ++i) block.core(i, i) = operators.masses[hubs[i]];
  } else {
    const SparseMatrix variation = operators.laplacian * curvature;
    block.sparse = curvature.transpose() * variation;
    if (count > 0) {
      append(block, rows_of(variation, hubs));
      const SparseMatrix among_hubs = rows_of(rows_of(operators.laplacian, hubs), hubs);
      block.core.topLeftCorner(count, count) = Eigen::MatrixXd(among_hubs);
      block.core.topRightCorner(count, count).setIdentity();
      block.core.bottomLeftCorner(count, count).setIdentity();
    }
  }
  pin(hubs, region, block);
  return block;
}

EnergyProduct::EnergyProduct(const SurfaceOperators& operators, Smoothness smoothness,
                             const Rows& values, Scratch& scratch, ThreadPool* pool)
    : laplacian_(operators.laplacian), last_(&values) {
  for (int order = 1; order < static_cast<int>(smoothness); ++order) {
    Rows& next = scratch[size_t(order % 2)];
    next.resize(values.rows(), 4);
    in_ranges(pool, values.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
      for (int64_t v = begin; v < end; ++v) next.row(v) = row(v) / operators.masses[v];
    });
    last_ = &next;
  }
}

Eigen::RowVector4d EnergyProduct::row(const Rows& values, Index vertex) const {
  Eigen::RowVector4d sum = Eigen::RowVector4d::Zero();
  for (SparseMatrix::InnerIterator it(laplacian_, vertex); it; ++it)  // L is symmetric
    sum += it.value() * values.row(it.row());
  return sum;
}

}  // namespace dd
