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

// Lengths as fractions of the diagonal of the target's box.
constexpr double kLoose = 0.05;  // δ: farther from the body, the weight of a vertex falls as d⁻²
constexpr double kProbed = 0.1;  // the farthest that a probe looks for the garment
// The largest distance between two layers of a garment. Bounds their search, which would take five
// times as long if it went as far as the body.
constexpr double kThick = 0.02;
constexpr double kSlight = 1e-4;  // a shift of this length has half the weight of a long one

// A point may lose this fraction of its distance at rest to the body, or to the layer below.
constexpr double kNearer = 0.25;
// Corrections are smoothed in the first rounds; the last ones move vertices one by one.
constexpr int kSmoothRounds = 3, kSingleRounds = 4;

/// The fraction of the missing distance that one round restores, by the body's outwardness there
/// (FarSides): over all rounds most of it at 1/2, nearly none at 1/10.
double share_of(double outwardness) { return outwardness * outwardness * outwardness; }

}  // namespace

WornPlaces::WornPlaces(const Mesh& source, const Mesh& target, const UnitBox& box,
                       const Region& region, const NearestPoints& points,
                       const Similarity& placement, const SourceGradients& gradients, double gap,
                       Precision precision, ThreadPool& pool, const Progress& progress)
    : source_(source),
      target_(target),
      region_(region),
      placement_(placement),
      gradients_(gradients),
      pool_(pool),
      fans_(target.triangles, target.vertex_count()),
      points_(source, points.of_vertices),
      unit_(box.scale),
      arms_(region.free_count(), 3),
      held_(Eigen::VectorXd::Zero(region.free_count())) {
  const Positions unit = box.into(target.positions);
  const SurfaceOperators operators = surface_operators(unit, target.triangles);
  for (int j = 0; j < target.triangle_count(); ++j)
    for (int v : target.triangles.row(j))
      if (region.row[size_t(v)] >= 0) held_[region.row[size_t(v)]] += operators.metric.areas[j] / 3;
  held_ = held_.cwiseMax(kLeastMass * held_.mean());
  for (int r = 0; r < region.free_count(); ++r) {
    const int v = region.free[size_t(r)];
    arms_.row(r) = target.positions.row(v) - placement(points_.at(source.positions, v)).transpose();
    held_[r] /= 1 + arms_.row(r).squaredNorm() / (kLoose * kLoose * unit_ * unit_);
  }
  const SparseMatrix laplacian = free_block(operators.laplacian, region);
  factor_ = Smoothing(laplacian, region, unit, held_, pool)
                .factored(kSmooth, precision, within(progress, 0, 0.8));
  if (gap >= 0) prepare_outside(points, gap * unit_);
}

RowMatrix WornPlaces::smooth(const RowMatrix& values) const {
  return factor_->solve(held_.asDiagonal() * values, &pool_);
}

void WornPlaces::prepare_outside(const NearestPoints& points, double gap) {
  Mesh body = {placement_.all(source_.positions), source_.triangles};
  std::vector<PointOnTriangle> seeds = points.of_vertices;
  for (PointOnTriangle& seed : seeds) seed.place = placement_(seed.place);
  if (signed_volume(body.positions, body.triangles) < 0) {  // inside out, or placed by a mirror
    body.triangles.col(1).swap(body.triangles.col(2));
    for (PointOnTriangle& seed : seeds) std::swap(seed.weights[1], seed.weights[2]);
  }
  body_ = std::make_unique<PosedSurface>(std::move(body), pool_);
  const AabbTree tree(body_->mesh());
  outside_ = std::make_unique<Outside>(*body_, tree, seeds, pool_);
  probes_ = std::make_unique<Probes>(*body_, tree, target_, kProbed * unit_, pool_);
  Positions arms = Positions::Zero(target_.vertex_count(), 3);  // zero for pinned vertices
  for (int r = 0; r < region_.free_count(); ++r) arms.row(region_.free[size_t(r)]) = arms_.row(r);
  layers_ = std::make_unique<Layers>(target_, arms, kThick * unit_, pool_);
  for (int v = 0; v < target_.vertex_count(); ++v)
    least_.push_back(outside_->at(v, target_.positions.row(v).transpose()).height);
  const auto inside = std::count_if(least_.begin(), least_.end(), [](double f) { return f < 0; });
  if (2 * inside > static_cast<std::ptrdiff_t>(least_.size())) side_ = -1;
  for (int i = 0; i < probes_->count(); ++i)
    least_.push_back(probes_->height(i, target_.positions));
  for (double& height : least_) {
    height *= side_;
    height = std::min(height - kNearer * std::abs(height), gap);
  }
  for (int v = 0; v < target_.vertex_count(); ++v)
    if (least_[size_t(v)] < 0) through_.push_back(v);
}

Positions WornPlaces::directions_of_layers() const {
  Positions result(layers_->count(), 3);
  pool_.parallel_for(result.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (int i = static_cast<int>(begin); i < end; ++i) {
      const Eigen::Vector3d arm =
          gradients_.mean_of(fans_.of(layers_->vertex(i))) * layers_->arm(i);
      const double length = arm.norm();
      result.row(i) = (length > 0 ? Eigen::Vector3d(arm / length) : arm).transpose();
    }
  });
  return result;
}

bool WornPlaces::look(const Positions& result, const Positions& upwards, Shifts& shifts) const {
  const Index vertices = target_.vertex_count();
  std::atomic<bool> any{false};
  const auto set = [&](Index i, double missing, const Eigen::Vector3d& direction,
                       const auto& outwardness) {
    missing = missing > 0 ? missing * share_of(outwardness()) : 0;
    shifts.rows.row(i) << side_ * direction.transpose(), missing;
    if (missing > 0) any = true;
  };
  pool_.parallel_for(vertices, kLeastRange, [&](int64_t begin, int64_t end) {
    for (Index v = begin; v < end; ++v) {
      const Eigen::Vector3d place = result.row(v).transpose();
      double& spare = shifts.spare[size_t(v)];
      // Twice, for safety: f changes by hardly more than the vertex moves.
      if (spare > 0 && 2 * (place - shifts.seen.row(v).transpose()).norm() < spare) continue;
      shifts.seen.row(v) = place.transpose();
      Outside::Level level = {0, Eigen::Vector3d::Zero()};
      spare = outside_->least(v, place, side_) - least_[size_t(v)];
      if (!(spare > 0)) {
        level = outside_->at(v, place);
        spare = side_ * level.height - least_[size_t(v)];
      }
      set(v, -spare, level.direction, [&] { return outside_->outwardness(v); });
    }
  });
  pool_.parallel_for(probes_->count(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (int i = static_cast<int>(begin); i < end; ++i)
      set(vertices + i, least_[size_t(vertices + i)] - side_ * probes_->height(i, result),
          probes_->direction(i), [&] { return probes_->outwardness(i); });
  });
  pool_.parallel_for(upwards.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (int i = static_cast<int>(begin); i < end; ++i) {
      const Eigen::Vector3d direction = upwards.row(i).transpose();
      set(static_cast<Index>(least_.size()) + i,
          (1 - kNearer) * layers_->arm(i).norm() - direction.dot(layers_->arm_in(i, result)),
          side_ * direction, [&] { return outside_->outwardness(layers_->vertex(i)); });
    }
  });
  return any;
}

Rows WornPlaces::gathered(const Shifts& shifts) const {
  Rows means = Rows::Zero(region_.free_count(), 4);
  pool_.parallel_for(means.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (Index r = begin; r < end; ++r) {
      const int v = region_.free[size_t(r)];
      double sum = 0;
      const auto add = [&](Index i, double part) {
        const double length = part * shifts.rows(i, 3);
        if (!(length > 0)) return;
        const double weight = length * length;
        means.row(r).head<3>() += weight * length * shifts.rows.row(i).head<3>();
        means(r, 3) += weight * length;
        sum += weight;
      };
      add(v, 1);
      for (const Probes::Part& part : probes_->of(v))
        add(target_.vertex_count() + part.probe, part.shift);
      if (const int layer = layers_->of(v); layer >= 0)
        add(static_cast<Index>(least_.size()) + layer, 1);
      if (sum > 0) means.row(r) /= sum;
    }
  });
  return means;
}

void WornPlaces::move_out(Positions& result) const {
  const Index vertices = target_.vertex_count();
  const Positions upwards = directions_of_layers();
  Shifts shifts{Rows::Zero(static_cast<Index>(least_.size()) + upwards.rows(), 4),
                Positions::Zero(vertices, 3),
                std::vector<double>(static_cast<size_t>(vertices), 0.0)};
  for (int round = 0; round < kSmoothRounds + kSingleRounds && look(result, upwards, shifts);
       ++round) {
    Rows wanted = gathered(shifts);
    if (round < kSmoothRounds) {
      for (Index r = 0; r < wanted.rows(); ++r) {
        const double say = wanted(r, 3) / (wanted(r, 3) + kSlight * unit_);
        wanted.row(r).head<3>() *= say;
        wanted(r, 3) = say;
      }
      wanted = smooth(wanted);
      for (Index r = 0; r < wanted.rows(); ++r)
        wanted.row(r).head<3>() /= std::max(wanted(r, 3), kEdge);
    }
    for (Index r = 0; r < wanted.rows(); ++r)
      result.row(region_.free[size_t(r)]) += wanted.row(r).head<3>();
  }
}

void WornPlaces::correct(const Positions& pose, Positions& result) {
  RowMatrix missing(region_.free_count(), 3);
  pool_.parallel_for(missing.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (Index r = begin; r < end; ++r) {
      const int v = region_.free[size_t(r)];
      missing.row(r) = placement_(points_.at(pose, v)).transpose() +
                       arms_.row(r) * gradients_.mean_of(fans_.of(v)).transpose() - result.row(v);
    }
  });
  const RowMatrix moved = smooth(missing);
  for (Index r = 0; r < moved.rows(); ++r) result.row(region_.free[size_t(r)]) += moved.row(r);
  if (!body_) return;
  body_->take(placement_.all(pose), pool_);
  probes_->look(pool_);
  move_out(result);
}

}  // namespace dd
