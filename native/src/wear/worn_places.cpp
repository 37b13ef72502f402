// SPDX-License-Identifier: GPL-3.0-or-later
#include "wear/worn_places.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <utility>

#include "mesh/triangles.h"
#include "systems/operators.h"
#include "transfer/smoothing.h"

namespace dd {

namespace {

// Lengths as fractions of the diagonal of the target's box:
// δ: farther from the body, the weight of a vertex falls with the square of its distance.
constexpr double kLooseDistance = 0.05;
constexpr double kMaxProbeDistance = 0.1;  // of a probe from the garment
// Largest distance between two layers of a garment. Bounds their search, which would take five
// times as long if it went as far as the body.
constexpr double kMaxLayerDistance = 0.02;
// Length of a shift that has half the weight of a long one where shifts are smoothed. Weights go to
// 0 with the length, so that no correction jumps where a vertex begins to need a shift.
constexpr double kHalfWeightShift = 1e-4;

// Fraction of its distance at rest to the body, or to the layer below, that a point may lose.
constexpr double kAllowedApproach = 0.25;
// Corrections are smoothed in the first rounds; the last ones move vertices one by one.
constexpr int kSmoothRounds = 3, kSingleRounds = 4;

/// The fraction of a missing height that one round restores, by the body's outwardness there
/// (FarSides). All seven rounds together restore 6/10 at an outwardness of 1/2 and 1/100 at 1/10,
/// so that corrections fade out where the body folds through itself.
double restored_fraction(double outwardness) { return outwardness * outwardness * outwardness; }

}  // namespace

WornPlaces::WornPlaces(const TransferContext& context, const Region& region,
                       const NearestPoints& points, double gap, const Progress& progress)
    : source_(*context.source),
      target_(*context.target),
      region_(region),
      placement_(*context.placement),
      gradients_(*context.gradients),
      pool_(*context.pool),
      fans_(target_.triangles, target_.vertex_count()),
      body_points_(source_, points.of_vertices),
      box_diagonal_(context.box->scale),
      body_offsets_(region.free_count(), 3),
      weights_(Eigen::VectorXd::Zero(region.free_count())) {
  const Positions unit = context.box->into(target_.positions);
  const SurfaceOperators operators = surface_operators(unit, target_.triangles);
  for (int j = 0; j < target_.triangle_count(); ++j)
    for (int v : target_.triangles.row(j))
      if (region.row[size_t(v)] >= 0)
        weights_[region.row[size_t(v)]] += operators.metric.areas[j] / 3;
  weights_ = weights_.cwiseMax(kMinRelativeMass * weights_.mean());
  for (int r = 0; r < region.free_count(); ++r) {
    const int v = region.free[size_t(r)];
    body_offsets_.row(r) =
        target_.positions.row(v) - placement_(body_points_.at(source_.positions, v)).transpose();
    weights_[r] /= 1 + body_offsets_.row(r).squaredNorm() /
                           (kLooseDistance * kLooseDistance * box_diagonal_ * box_diagonal_);
  }
  const SparseMatrix laplacian = free_block(operators.laplacian, region);
  factor_ = Smoothing(laplacian, region, unit, weights_, pool_)
                .factored(kSmoothingLength, context.precision, within(progress, 0, 0.8));
  if (gap >= 0) prepare_outside(points, gap * box_diagonal_);
}

RowMatrix WornPlaces::smooth(const RowMatrix& values) const {
  return factor_->solve(weights_.asDiagonal() * values, &pool_);
}

void WornPlaces::prepare_outside(const NearestPoints& points, double gap) {
  Mesh body = {placement_.all(source_.positions), source_.triangles};
  std::vector<PointOnTriangle> seeds = points.of_vertices;
  for (PointOnTriangle& seed : seeds) seed.position = placement_(seed.position);
  if (signed_volume(body.positions, body.triangles) < 0) {  // inside out, or placed by a mirror
    body.triangles.col(1).swap(body.triangles.col(2));
    for (PointOnTriangle& seed : seeds) std::swap(seed.barycentric[1], seed.barycentric[2]);
  }
  body_ = std::make_unique<PosedSurface>(std::move(body), pool_);
  const AabbTree tree(body_->mesh());
  outside_ = std::make_unique<Outside>(*body_, tree, seeds, pool_);
  probes_ =
      std::make_unique<Probes>(*body_, tree, target_, kMaxProbeDistance * box_diagonal_, pool_);
  Positions body_offsets = Positions::Zero(target_.vertex_count(), 3);  // zero for pinned vertices
  for (int r = 0; r < region_.free_count(); ++r)
    body_offsets.row(region_.free[size_t(r)]) = body_offsets_.row(r);
  layers_ =
      std::make_unique<Layers>(target_, body_offsets, kMaxLayerDistance * box_diagonal_, pool_);
  for (int v = 0; v < target_.vertex_count(); ++v)
    min_heights_.push_back(outside_->at(v, target_.positions.row(v).transpose()).height);
  const auto inside_count =
      std::count_if(min_heights_.begin(), min_heights_.end(), [](double f) { return f < 0; });
  if (2 * inside_count > static_cast<std::ptrdiff_t>(min_heights_.size())) body_side_ = -1;
  for (int i = 0; i < probes_->count(); ++i)
    min_heights_.push_back(probes_->height(i, target_.positions));
  for (double& height : min_heights_) {
    height *= body_side_;
    height = std::min(height - kAllowedApproach * std::abs(height), gap);
  }
  for (int v = 0; v < target_.vertex_count(); ++v)
    if (min_heights_[size_t(v)] < 0) penetrating_.push_back(v);
}

Positions WornPlaces::directions_of_layers() const {
  Positions result(layers_->count(), 3);
  pool_.parallel_for(result.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (int i = static_cast<int>(begin); i < end; ++i) {
      const Eigen::Vector3d offset =
          gradients_.mean_of(fans_.of(layers_->vertex(i))) * layers_->offset(i);
      const double length = offset.norm();
      result.row(i) = (length > 0 ? Eigen::Vector3d(offset / length) : offset).transpose();
    }
  });
  return result;
}

bool WornPlaces::compute_shifts(const Positions& result, const Positions& layer_directions,
                                Shifts& shifts) const {
  const Index vertices = target_.vertex_count();
  std::atomic<bool> any{false};
  const auto set = [&](Index i, double residual, const Eigen::Vector3d& direction,
                       const auto& outwardness) {
    residual = residual > 0 ? residual * restored_fraction(outwardness()) : 0;
    shifts.rows.row(i) << body_side_ * direction.transpose(), residual;
    if (residual > 0) any = true;
  };
  pool_.parallel_for(vertices, kLeastRange, [&](int64_t begin, int64_t end) {
    for (Index v = begin; v < end; ++v) {
      const Eigen::Vector3d position = result.row(v).transpose();
      double& margin = shifts.margins[size_t(v)];
      // A vertex that has moved by less than half of its margin still has one: f changes by hardly
      // more than the vertex moves, and the half is for safety.
      if (margin > 0 && 2 * (position - shifts.last_positions.row(v).transpose()).norm() < margin)
        continue;
      shifts.last_positions.row(v) = position.transpose();
      Outside::Height height = {0, Eigen::Vector3d::Zero()};
      margin = outside_->lower_bound(v, position, body_side_) - min_heights_[size_t(v)];
      if (!(margin > 0)) {
        height = outside_->at(v, position);
        margin = body_side_ * height.height - min_heights_[size_t(v)];
      }
      set(v, -margin, height.direction, [&] { return outside_->outwardness(v); });
    }
  });
  pool_.parallel_for(probes_->count(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (int i = static_cast<int>(begin); i < end; ++i)
      set(vertices + i,
          min_heights_[size_t(vertices + i)] - body_side_ * probes_->height(i, result),
          probes_->direction(i), [&] { return probes_->outwardness(i); });
  });
  pool_.parallel_for(layer_directions.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (int i = static_cast<int>(begin); i < end; ++i) {
      const Eigen::Vector3d direction = layer_directions.row(i).transpose();
      set(static_cast<Index>(min_heights_.size()) + i,
          (1 - kAllowedApproach) * layers_->offset(i).norm() -
              direction.dot(layers_->offset_in(i, result)),
          body_side_ * direction, [&] { return outside_->outwardness(layers_->vertex(i)); });
    }
  });
  return any;
}

Rows WornPlaces::mean_shifts(const Shifts& shifts) const {
  Rows means = Rows::Zero(region_.free_count(), 4);
  pool_.parallel_for(means.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (Index r = begin; r < end; ++r) {
      const int v = region_.free[size_t(r)];
      double sum = 0;
      const auto add = [&](Index i, double factor) {
        const double length = factor * shifts.rows(i, 3);
        if (!(length > 0)) return;
        const double weight = length * length;
        means.row(r).head<3>() += weight * length * shifts.rows.row(i).head<3>();
        means(r, 3) += weight * length;
        sum += weight;
      };
      add(v, 1);
      for (const Probes::CornerShift& corner_shift : probes_->of(v))
        add(target_.vertex_count() + corner_shift.probe, corner_shift.shift);
      if (const int layer = layers_->of(v); layer >= 0)
        add(static_cast<Index>(min_heights_.size()) + layer, 1);
      if (sum > 0) means.row(r) /= sum;
    }
  });
  return means;
}

void WornPlaces::move_out(Positions& result) const {
  const Index vertices = target_.vertex_count();
  const Positions layer_directions = directions_of_layers();
  Shifts shifts{Rows::Zero(static_cast<Index>(min_heights_.size()) + layer_directions.rows(), 4),
                Positions::Zero(vertices, 3),
                std::vector<double>(static_cast<size_t>(vertices), 0.0)};
  for (int round = 0;
       round < kSmoothRounds + kSingleRounds && compute_shifts(result, layer_directions, shifts);
       ++round) {
    Rows shifts_of_rows = mean_shifts(shifts);
    if (round < kSmoothRounds) {
      for (Index r = 0; r < shifts_of_rows.rows(); ++r) {
        const double weight =
            shifts_of_rows(r, 3) / (shifts_of_rows(r, 3) + kHalfWeightShift * box_diagonal_);
        shifts_of_rows.row(r).head<3>() *= weight;
        shifts_of_rows(r, 3) = weight;
      }
      shifts_of_rows = smooth(shifts_of_rows);
      for (Index r = 0; r < shifts_of_rows.rows(); ++r)
        shifts_of_rows.row(r).head<3>() /= std::max(shifts_of_rows(r, 3), kMinSmoothedIndicator);
    }
    for (Index r = 0; r < shifts_of_rows.rows(); ++r)
      result.row(region_.free[size_t(r)]) += shifts_of_rows.row(r).head<3>();
  }
}

void WornPlaces::correct(const Positions& pose, Positions& result) {
  RowMatrix residual(region_.free_count(), 3);
  pool_.parallel_for(residual.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (Index r = begin; r < end; ++r) {
      const int v = region_.free[size_t(r)];
      residual.row(r) = placement_(body_points_.at(pose, v)).transpose() +
                        body_offsets_.row(r) * gradients_.mean_of(fans_.of(v)).transpose() -
                        result.row(v);
    }
  });
  const RowMatrix smoothed = smooth(residual);
  for (Index r = 0; r < smoothed.rows(); ++r)
    result.row(region_.free[size_t(r)]) += smoothed.row(r);
  if (!body_) return;
  body_->set_pose(placement_.all(pose), pool_);
  probes_->update_directions(pool_);
  move_out(result);
}

}  // namespace dd
