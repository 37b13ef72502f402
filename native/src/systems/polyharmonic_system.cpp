// SPDX-License-Identifier: GPL-3.0-or-later
#include "systems/polyharmonic_system.h"

#include <algorithm>

#include "systems/free_block.h"

namespace dd {

namespace {

// Rounds of iterative refinement, the first solve included: two at least, since the second shows
// the error of the first. Safety: at most 12, each of which must halve the correction.
constexpr int kLeastSolves = 2, kMostSolves = 12;
// Fractions of the largest value. Refinement ends when the next correction is predicted to be below
// kConvergedChange. If it does not get there, a last correction above kMaxFinalChange is an error:
// fewer than six digits are right.
constexpr double kConvergedChange = 1e-11, kMaxFinalChange = 1e-6;

BlockOptions tolerant(BlockOptions options) {
  options.smallest_pivot = kSmallestPivotOfK;  // extend() tests the solution instead
  return options;
}

}  // namespace

PolyharmonicSystem::PolyharmonicSystem(const SurfaceOperators& operators, const Region& region,
                                       Smoothness smoothness, const BlockOptions& options)
    : PolyharmonicSystem(operators, region, smoothness, energy_block(operators, region, smoothness),
                         options) {}

PolyharmonicSystem::PolyharmonicSystem(const SurfaceOperators& operators, const Region& region,
                                       Smoothness smoothness, const EnergyBlock& block,
                                       const BlockOptions& options)
    : operators_(operators),
      region_(region),
      smoothness_(smoothness),
      factor_(std::make_shared<UpdatedCholesky>(
          factor_free_block(block.sparse, region, tolerant(options)), block.vectors, block.core,
          options.pool)),
      pool_(options.pool) {}

RowMatrix PolyharmonicSystem::extend(const RowMatrix& values, double* one_solve_error) const {
  RowMatrix result(region_.free_count(), values.cols());
  Scratch scratch;
  scratch.values.resize(values.rows(), 4);
  double most = 0;
  for (FourColumns some(values); some.next();) {
    for (Index v = 0; v < values.rows(); ++v) scratch.values.row(v) = some(v);
    double error = 0;
    result.middleCols(some.first(), some.width()) = extend(scratch, &error).leftCols(some.width());
    most = std::max(most, error);
  }
  if (one_solve_error) *one_solve_error = most;
  return result;
}

const Rows& PolyharmonicSystem::extend(Scratch& scratch, double* one_solve_error) const {
  Rows &x = scratch.values, &correction = scratch.solution;
  for (int v : region_.free) x.row(v).setZero();
  // Iterative refinement: where triangles are thin or the region is long, K is ill-conditioned and
  // its factor loses digits that the product L (M⁻¹ (L x)) still has. The first correction is the
  // solution itself; the last one estimates the error.
  double last = 1;
  Eigen::RowVector4d corrected = Eigen::RowVector4d::Zero();
  for (int round = 0;; ++round) {
    const EnergyProduct product(operators_, smoothness_, x, scratch.product, pool_);
    factor_->solve_rows(
        [&](int r) -> Eigen::RowVector4d { return -product.row(region_.free[size_t(r)]); },
        correction, scratch.solve, pool_);
    for (int r = 0; r < region_.free_count(); ++r) x.row(region_.free[r]) += correction.row(r);
    const Eigen::RowVector4d changes = correction.cwiseAbs().colwise().maxCoeff();
    const double change = changes.maxCoeff(), size = x.cwiseAbs().maxCoeff();
    if (round > 0) corrected += changes;
    // Predicts the next correction from the ratio of the last two.
    if (round + 1 >= kLeastSolves && change * (change / last) <= kConvergedChange * size) break;
    const bool converges = round == 0 || change < 0.5 * last;
    last = change;
    if (round + 1 < kLeastSolves || (round + 1 < kMostSolves && converges)) continue;
    if (change <= kMaxFinalChange * size) break;
    Index row = 0, column = 0;
    correction.cwiseAbs().maxCoeff(&row, &column);
    throw UnsolvableSurface(region_.free[row]);
  }
  if (one_solve_error) {
    *one_solve_error = 0;
    for (Index c = 0; c < 4; ++c)
      if (corrected[c] > 0)
        *one_solve_error =
            std::max(*one_solve_error, corrected[c] / x.col(c).cwiseAbs().maxCoeff());
  }
  for (int r = 0; r < region_.free_count(); ++r) correction.row(r) = x.row(region_.free[r]);
  return correction;
}

}  // namespace dd
