// SPDX-License-Identifier: GPL-3.0-or-later
#include "methods/displacement_volumes.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "systems/free_block.h"

namespace dd {

namespace {

using Eigen::Vector3d;

// ℓ and √μ as multiples of the mean height of the prisms. Smaller ℓ keeps the surface closer to the
// normal displacements, smaller μ keeps the volumes more exactly.
constexpr double kPositionLengthHeights = 4, kVolumeWeightHeights = 0.1;

/// The prism between triangles q and p = q + d, d linear over the triangle, swept along straight
/// lines. Its volume is V = d̄ · W / 2, with d̄ the mean of d and W the integral of the edges'
/// cross product over the sweep.
struct SweptPrism {
  Vector3d e1, e2, f1, f2, mean, swept_cross;

  SweptPrism(const Vector3d (&q)[3], const Vector3d (&d)[3])
      : e1(q[1] - q[0]), e2(q[2] - q[0]), f1(d[1] - d[0]), f2(d[2] - d[0]) {
    mean = (d[0] + d[1] + d[2]) / 3;
    swept_cross = e1.cross(e2) + 0.5 * (e1.cross(f2) + f1.cross(e2)) + f1.cross(f2) / 3;
  }
  double volume() const { return 0.5 * mean.dot(swept_cross); }
  /// ∂V/∂p of the three corners, as columns.
  Eigen::Matrix3d gradient() const {
    const Vector3d first = 0.5 * e2.cross(mean) + f2.cross(mean) / 3;
    const Vector3d second = 0.5 * mean.cross(e1) + mean.cross(f1) / 3;
    Eigen::Matrix3d columns;
    columns.col(0) = 0.5 * (swept_cross / 3 - first - second);
    columns.col(1) = 0.5 * (swept_cross / 3 + first);
    columns.col(2) = 0.5 * (swept_cross / 3 + second);
    return columns;
  }
};

SparseMatrix free_rows_in_order(const SparseMatrix& matrix, const RowOrder& order) {
  std::vector<Eigen::Triplet<double>> entries;
  for (int r = 0; r < order.free_count; ++r)
    for (SparseMatrix::InnerIterator it(matrix, order.vertex_of_row[r]); it; ++it) {
      const int other = order.row_of_vertex[it.row()];
      if (other < order.free_count) entries.emplace_back(other, r, it.value());
    }
  SparseMatrix result(order.free_count, order.free_count);
  result.setFromTriplets(entries.begin(), entries.end());
  return result;
}

}  // namespace

DisplacementVolumes::DisplacementVolumes(BoundSurface& bound, const Progress& progress)
    : bound_(bound), detail_(bound), normal_(bound) {
  const RowOrder& order = bound.order();
  const std::vector<int> active = bound.faces_with_free_corners();
  free_triangles_.resize(static_cast<Index>(active.size()), 3);
  for (size_t i = 0; i < active.size(); ++i)
    for (int k = 0; k < 3; ++k)
      free_triangles_(Index(i), k) = order.row_of_vertex[bound.mesh.triangles(active[i], k)];
  volume_gradients_.resize(active.size());
  masses_.resize(order.free_count);
  for (int r = 0; r < order.free_count; ++r)
    masses_[r] = bound.operators.masses[order.vertex_of_row[r]];
  rest_volumes_ = Vector::Zero(order.free_count);
  rest_volumes_ = volume_changes(bound.rest, bound.rest_base);
  mean_height_ = rest_volumes_.cwiseAbs().sum() / masses_.sum();
  if (mean_height_ < 1e-9) return;  // in the unit box, rounding: S is its own base

  system_ = free_rows_in_order(bound.operators.laplacian, order);
  const double position_length = kPositionLengthHeights * mean_height_;
  for (int r = 0; r < order.free_count; ++r)
    system_.coeffRef(r, r) += masses_[r] / (position_length * position_length);
  FactorOptions options;
  options.stage = Stage::volumes;
  if (progress) options.progress = [&](double, Stage stage) { return progress(0, stage); };
  try {
    factor_ = std::make_unique<SparseCholesky>(system_, options);
  } catch (const SingularMatrix& singular) {
    throw UnsolvableSurface(order.vertex_of_row[singular.row()]);
  }
}

DisplacementVolumes::Vector DisplacementVolumes::volume_changes(const Rows& surface,
                                                                const Rows& base) {
  const int free_count = bound_.order().free_count;
  Vector volumes = -rest_volumes_;
  for (Index j = 0; j < free_triangles_.rows(); ++j) {
    Vector3d q[3], d[3];
    for (int k = 0; k < 3; ++k) {
      const int r = free_triangles_(j, k);
      q[k] = base.row(r).head<3>();
      d[k] = (surface.row(r) - base.row(r)).head<3>();
    }
    const SweptPrism prism(q, d);
    for (int k = 0; k < 3; ++k)
      if (free_triangles_(j, k) < free_count) volumes[free_triangles_(j, k)] += prism.volume() / 3;
    volume_gradients_[static_cast<size_t>(j)] = prism.gradient();
  }
  return volumes;
}

Rows DisplacementVolumes::transposed_jacobian_product(const Vector& multipliers) const {
  const int free_count = bound_.order().free_count;
  Rows result = Rows::Zero(free_count, 4);
  for (Index j = 0; j < free_triangles_.rows(); ++j) {
    double mean = 0;
    for (int k = 0; k < 3; ++k)
      if (free_triangles_(j, k) < free_count) mean += multipliers[free_triangles_(j, k)] / 3;
    for (int k = 0; k < 3; ++k)
      if (free_triangles_(j, k) < free_count)
        result.row(free_triangles_(j, k)).head<3>() +=
            mean * volume_gradients_[static_cast<size_t>(j)].col(k).transpose();
  }
  return result;
}

DisplacementVolumes::Vector DisplacementVolumes::jacobian_product(const Rows& displacement) const {
  const int free_count = bound_.order().free_count;
  Vector result = Vector::Zero(free_count);
  for (Index j = 0; j < free_triangles_.rows(); ++j) {
    double change = 0;
    for (int k = 0; k < 3; ++k)
      if (free_triangles_(j, k) < free_count)
        change += displacement.row(free_triangles_(j, k))
                      .head<3>()
                      .dot(volume_gradients_[static_cast<size_t>(j)].col(k));
    for (int k = 0; k < 3; ++k)
      if (free_triangles_(j, k) < free_count) result[free_triangles_(j, k)] += change / 3;
  }
  return result;
}

DisplacementVolumes::Vector DisplacementVolumes::preconditioned(const Vector& residual) const {
  // J ≈ M N with the unit normals N, so J H⁻¹ Jᵀ ≈ M H⁻¹ M, whose inverse is M⁻¹ H M⁻¹.
  const Vector scaled = residual.cwiseQuotient(masses_);
  return Vector(system_ * scaled).cwiseQuotient(masses_);
}

template <class CheckCancelled>
Rows DisplacementVolumes::restoring_displacement(const Vector& wanted,
                                                 const CheckCancelled& check_cancelled) const {
  constexpr int kMaxConjugateGradientSteps = 100;  // limit on iterations of conjugate gradients
  // Residual to stop at, relative to the right-hand side. Smaller makes a Gauss-Newton step more
  // exact, but longer.
  constexpr double kRelativeResidual = 1e-2;
  const double softness = kVolumeWeightHeights * mean_height_ * kVolumeWeightHeights * mean_height_;
  Rows shift = Rows::Zero(bound_.order().free_count, 4);
  Vector residual = wanted, z = preconditioned(residual), direction = z;
  double product = residual.dot(z);
  const double residual_limit = kRelativeResidual * wanted.norm();
  for (int round = 0; round < kMaxConjugateGradientSteps && residual.norm() > residual_limit;
       ++round) {
    check_cancelled();
    const Rows forces = transposed_jacobian_product(direction);
    const RowMatrix solved = factor_->solve(forces.leftCols<3>());
    Rows moved = Rows::Zero(forces.rows(), 4);
    moved.leftCols<3>() = solved;
    const Vector image = jacobian_product(moved) + softness * masses_.cwiseProduct(direction);
    const double length = product / direction.dot(image);
    if (!std::isfinite(length)) break;
    shift += length * moved;
    residual -= length * image;
    z = preconditioned(residual);
    const double next = residual.dot(z);
    direction = z + next / product * direction;
    product = next;
  }
  return shift;
}

void DisplacementVolumes::update(const Frame& frame, const MethodOptions& options) {
  MethodOptions linear = options;
  linear.refined = {};
  linear.formulation = Formulation::surface;
  linear.levels = 1;
  normal_.update(frame, linear);
  volume_error_ = 0;
  converged_ = true;
  if (!factor_) return;

  const int free_count = bound_.order().free_count;
  const Rows normal_offsets = frame.offsets;
  detail_.update(frame, linear);
  // The minimizer without the volume term: H p₀ = L p_T + M p_N / ℓ².
  const double position_length = kPositionLengthHeights * mean_height_;
  const RowMatrix pull = (masses_ / (position_length * position_length)).asDiagonal() *
                         RowMatrix((normal_offsets - frame.offsets).topLeftCorner(free_count, 3));
  Rows start = bound_.rest + frame.offsets;
  start.topLeftCorner(free_count, 3) += factor_->solve(pull);

  // Step limit in mean heights: beyond it the linearization of the volumes is poor.
  constexpr double kMaxStepHeights = 0.3;
  Rows surface = start, shift = Rows::Zero(free_count, 4);
  double first_change = 0, done = 0;
  // Called in each iteration, which takes as long as a frame, so that a step of up to a hundred of
  // them can be cancelled.
  const auto check_cancelled = [&] { report(options.progress, done, Stage::restoring); };
  converged_ = false;
  for (int step = 0; step < options.volume_iterations && !converged_; ++step) {
    const Vector changes = volume_changes(surface, frame.base);
    Rows change =
        restoring_displacement(jacobian_product(shift) - changes, check_cancelled) - shift;
    const double largest = change.cwiseAbs().maxCoeff() / mean_height_;
    if (!std::isfinite(largest))
      throw Error(Status::numeric,
                  "The volumes can't be restored: the handles' motion is too large",
                  Remedy::move_less);
    if (largest > kMaxStepHeights) change *= kMaxStepHeights / largest;
    shift += change;
    surface.topRows(free_count) = start.topRows(free_count) + shift;
    converged_ = largest <= options.volume_tolerance;

    first_change = std::max(first_change, largest);
    const double left = (largest - options.volume_tolerance) /
                        std::max(first_change - options.volume_tolerance, 1e-300);
    done = std::max(done, std::clamp(1 - left, 0.0, 0.99));  // never falls, though largest may rise
    check_cancelled();
  }
  volume_error_ =
      volume_changes(surface, frame.base).cwiseAbs().sum() / rest_volumes_.cwiseAbs().sum();
  frame.offsets.topRows(free_count) = surface.topRows(free_count) - bound_.rest.topRows(free_count);
}

MethodFindings DisplacementVolumes::findings() const {
  MethodFindings findings;
  findings.volume_error = volume_error_;
  findings.converged = converged_;
  return findings;
}

double DisplacementVolumes::bytes() const {
  return detail_.bytes() + normal_.bytes() + (factor_ ? factor_->bytes() : 0) +
         static_cast<double>(volume_gradients_.size() * sizeof(Eigen::Matrix3d)) +
         static_cast<double>(free_triangles_.size()) * sizeof(int) +
         static_cast<double>(system_.nonZeros()) * (sizeof(double) + sizeof(int)) +
         static_cast<double>(masses_.size() + rest_volumes_.size()) * sizeof(double);
}

}  // namespace dd
