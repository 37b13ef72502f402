// SPDX-License-Identifier: GPL-3.0-or-later
#include "systems/handle_solve.h"

#include <cmath>
#include <utility>

namespace dd {

namespace {

/// Largest accepted error of a frame's solution that is due to a rounded factor, as a fraction of
/// its largest value. Below the 3e-6 that PoissonSystem accepts for the surface. Measured: 4e-7 to
/// 9e-7 on planes of 25,000 to 250,000 vertices with 60 to 500 handles; 7e-4 along a strip of 2,500
/// rows, where double precision is kept.
constexpr double kAcceptedRounding = 2e-6;

/// For each vertex whether it is in the given set or has a neighbour in it.
std::vector<char> grown(const std::vector<char>& set, const SparseMatrix& laplacian) {
  std::vector<char> result(set.size(), 0);
  for (Index v = 0; v < laplacian.cols(); ++v) {
    if (!set[v]) continue;
    result[v] = 1;
    for (SparseMatrix::InnerIterator it(laplacian, v); it; ++it) result[it.row()] = 1;
  }
  return result;
}

/// −K_FC, C the handles' vertices, in sparse factors; the first in the result is applied first.
std::vector<SparseMatrix> coupling(const SurfaceOperators& operators, const Region& region,
                                   Smoothness smoothness) {
  const int order = static_cast<int>(smoothness);
  const size_t n = region.role.size();
  std::vector<char> free(n, 0);
  for (int v : region.free) free[v] = 1;
  // influence_rings[k]: vertices within k edges of a free one.
  std::vector<std::vector<char>> influence_rings{free};
  for (int k = 1; k < order; ++k)
    influence_rings.push_back(grown(influence_rings.back(), operators.laplacian));

  // Column of each vertex in the current factor; -1: none.
  std::vector<int> from(n, -1);
  Index columns = 0;
  for (int v : region.handle_vertices) from[v] = static_cast<int>(columns++);
  std::vector<SparseMatrix> steps;
  for (int k = 1; k <= order; ++k) {
    std::vector<char> begin(n, 0);
    for (size_t v = 0; v < n; ++v) begin[v] = from[v] >= 0;
    const std::vector<char> reached = grown(begin, operators.laplacian);
    std::vector<int> to(n, -1);
    Index rows = 0;
    if (k == order) {
      to = region.row;
      rows = region.free_count();
    } else {
      for (size_t v = 0; v < n; ++v)
        if (reached[v] && influence_rings[size_t(order - k)][v]) to[v] = static_cast<int>(rows++);
    }
    std::vector<Eigen::Triplet<double>> entries;
    for (size_t v = 0; v < n; ++v) {
      if (from[v] < 0) continue;
      for (SparseMatrix::InnerIterator it(operators.laplacian, Index(v)); it; ++it)
        if (to[it.row()] >= 0)
          entries.emplace_back(to[it.row()], from[v],
                               k == order ? -it.value() : it.value() / operators.masses[it.row()]);
    }
    steps.emplace_back(rows, columns);
    steps.back().setFromTriplets(entries.begin(), entries.end());
    from = std::move(to);
    columns = rows;
  }
  return steps;
}

}  // namespace

HandleSolve::HandleSolve(const PolyharmonicSystem& energy_system, const Region& region,
                         ThreadPool* pool)
    : factor_(energy_system.factor()),
      steps_(coupling(energy_system.operators(), region, energy_system.smoothness())),
      pool_(pool) {}

const Rows& HandleSolve::extend(const Rows& values, Scratch& scratch) const {
  const Rows* force = &values;
  scratch.forces.resize(steps_.size());
  for (size_t k = 0; k < steps_.size(); ++k) {
    scratch.forces[k].noalias() = steps_[k] * *force;
    force = &scratch.forces[k];
  }
  factor_->solve_rows([&](int row) { return force->row(row); }, scratch.solution, scratch.solve,
                      pool_);
  return scratch.solution;
}

void HandleSolve::prepare_frames(SparseMatrix at_handles, const std::vector<int>& row_of_free,
                                 Precision precision) {
  at_handles_ = std::move(at_handles);
  const SparseCholesky& factor = factor_->factor();
  const SymbolicCholesky& symbolic = factor.symbolic();
  out_row_.clear();
  for (int free : symbolic.order) out_row_.push_back(row_of_free[size_t(free)]);
  if (!factor_->plain()) return;
  SparseMatrix force = at_handles_;
  for (const SparseMatrix& step : steps_) force = SparseMatrix(step * force);
  const Eigen::PermutationMatrix<Eigen::Dynamic> permutation(
      Eigen::Map<const Eigen::VectorXi>(symbolic.index_of.data(), symbolic.size()));
  // At most half of the factor's entries: a frame reads these in place of the factor when it
  // substitutes forward.
  forward_ = SparseForward(factor, permutation * force, factor.entries() / 2);
  if (precision == Precision::full || !has_precomputed_forward()) return;
  auto single = std::make_unique<SparseCholesky>(factor.in_single(pool_));
  if (error_of(*single) < kAcceptedRounding) single_ = std::move(single);
}

template <class Done>
void HandleSolve::backward_solve(const SparseCholesky& factor, const Rows& coefficients,
                                 SparseCholesky::SolveScratch& scratch, const Done& done,
                                 Columns columns) const {
  factor.backward_solve(
      scratch, pool_, [&](int section, auto* y) { forward_.multiply(section, coefficients, y); },
      done, columns);
}

/// Relative error of the rounded factor for motions that are constant or vary slowly over the
/// handles, where rounding accumulates most, and for motions that vary from handle to handle.
double HandleSolve::error_of(const SparseCholesky& single) const {
  Rows coefficients(at_handles_.cols(), 4);
  for (Index k = 0; k < coefficients.rows(); ++k)
    coefficients.row(k) << 1, std::sin(1 + 0.07 * double(k)), std::sin(1 + 2.4 * double(k)),
        k % 2 ? -1 : 1;
  const auto solution = [&](const SparseCholesky& factor) {
    SparseCholesky::SolveScratch scratch;
    Rows result(factor.size(), 4);
    backward_solve(
        factor, coefficients, scratch,
        [&](int begin, int end, const auto* x) {
          for (int k = begin; k < end; ++k, x += 4)
            for (int c = 0; c < 4; ++c) result(k, c) = x[c];
        },
        Columns::four);
    return result;
  };
  const Rows exact = solution(factor_->factor()), rounded = solution(single);
  return ((rounded - exact).cwiseAbs().colwise().maxCoeff().array() /
          exact.cwiseAbs().colwise().maxCoeff().array())
      .maxCoeff();
}

void HandleSolve::add_extended(const Rows& coefficients, const Rows& rest, Rows& out) {
  const auto add = [&](int index, const auto* x) {
    const Index row = out_row_[size_t(index)];
    for (int c = 0; c < 3; ++c) out(row, c) = rest(row, c) + double(x[c]);
  };
  if (!has_precomputed_forward()) {
    const Rows& moved = extend(at_handles_ * coefficients, scratch_);
    const std::vector<int>& order = factor_->factor().order();
    for (size_t k = 0; k < order.size(); ++k) add(int(k), moved.row(order[k]).data());
    return;
  }
  backward_solve(
      in_single() ? *single_ : factor_->factor(), coefficients, scratch_.solve,
      [&](int begin, int end, const auto* x) {
        for (int k = begin; k < end; ++k, x += 4) add(k, x);
      },
      Columns::three);
}

double HandleSolve::bytes() const {
  size_t doubles = scratch_.solve.full.size() + scratch_.solve.single.size() / 2 +
                   size_t(scratch_.solve.right.size()) + size_t(scratch_.solution.size());
  for (const Rows& force : scratch_.forces) doubles += size_t(force.size());
  double sum = factor_->bytes() + forward_.bytes() + static_cast<double>(doubles * sizeof(double));
  const auto add = [&](const SparseMatrix& matrix) {
    sum += static_cast<double>(matrix.nonZeros()) * (sizeof(double) + sizeof(int));
  };
  for (const SparseMatrix& step : steps_) add(step);
  add(at_handles_);
  if (in_single()) sum += single_->bytes();
  return sum + static_cast<double>(out_row_.size() * sizeof(int));
}

}  // namespace dd
