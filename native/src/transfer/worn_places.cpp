// SPDX-License-Identifier: GPL-3.0-or-later
#include "transfer/worn_places.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <utility>

#include "mesh/triangles.h"
#include "systems/operators.h"
#include "transfer/smoothing.h"

namespace dd {

namespace {

// Of the box.
constexpr double kSmooth = 0.01;  // ℓ
constexpr double kLoose = 0.05;   // δ
constexpr double kSlight = 1e-4;  // of shifts: less has less of a say

constexpr double kEdge = 0.25;       // share of a shift's weight that smoothing leaves, at least
constexpr double kLeastMass = 1e-3;  // of the mean
constexpr double kNearer = 0.25;     // of its distance at rest that a point may come nearer
constexpr int kSmoothRounds = 3, kSingleRounds = 4;

std::vector<PointOnTriangle> placed(std::vector<PointOnTriangle> points,
                                    const Similarity& placement) {
  for (PointOnTriangle& point : points) point.place = placement(point.place);
  return points;
}

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
  if (gap >= 0) prepare_outside(points, gap);
}

Positions WornPlaces::placed(const Positions& of_source) const {
  return (placement_.scale * of_source * placement_.rotation.transpose()).rowwise() +
         placement_.shift.transpose();
}

RowMatrix WornPlaces::smooth(const RowMatrix& values) const {
  return factor_->solve(held_.asDiagonal() * values, &pool_);
}

void WornPlaces::prepare_outside(const NearestPoints& points, double gap) {
  std::vector<PointOnTriangle> seeds = dd::placed(points.of_vertices, placement_);
  for (PointOnTriangle& point : dd::placed(points.of_centres, placement_)) seeds.push_back(point);
  outside_ =
      std::make_unique<Outside>(Mesh{placed(source_.positions), source_.triangles}, seeds, pool_);
  for (Index i = 0; i < outside_->count(); ++i)
    least_.push_back(outside_->at(i, place_of(i, target_.positions)).height);
  const auto inside = std::count_if(least_.begin(), least_.end(), [](double f) { return f < 0; });
  if (2 * inside > static_cast<std::ptrdiff_t>(least_.size())) side_ = -1;
  for (double& height : least_) {
    height *= side_;
    height = std::min(height - kNearer * std::abs(height), gap);
  }
}

Eigen::Vector3d WornPlaces::place_of(Index point, const Positions& positions) const {
  const Index j = point - target_.vertex_count();
  return j < 0 ? Eigen::Vector3d(positions.row(point).transpose())
               : triangle_centre(positions, target_.triangles, j);
}

bool WornPlaces::look(const Positions& result, Shifts& shifts) const {
  std::atomic<bool> any{false};
  pool_.parallel_for(outside_->count(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (Index i = begin; i < end; ++i) {
      const Eigen::Vector3d place = place_of(i, result);
      double& spare = shifts.spare[size_t(i)];
      // Twice: f grows by hardly more than the way.
      if (spare > 0 && 2 * (place - shifts.seen.row(i).transpose()).norm() < spare) continue;
      shifts.seen.row(i) = place.transpose();
      spare = outside_->least(i, place, side_) - least_[size_t(i)];
      if (spare > 0) {
        shifts.rows.row(i).setZero();
        continue;
      }
      const Outside::Level level = outside_->at(i, place);
      spare = side_ * level.height - least_[size_t(i)];
      const double missing = std::max(0.0, -spare);
      shifts.rows.row(i) << missing * side_ * level.direction.transpose(), missing;
      if (missing > 0) any = true;
    }
  });
  return any;
}

Rows WornPlaces::gathered(const Rows& shifts) const {
  Rows sums = Rows::Zero(region_.free_count(), 4);
  pool_.parallel_for(sums.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (Index r = begin; r < end; ++r) {
      const int v = region_.free[size_t(r)];
      const auto add = [&](Index i) {
        const double length = shifts(i, 3);
        sums.row(r).head<3>() += length * shifts.row(i).head<3>();
        sums(r, 3) += length;
      };
      add(v);
      for (int j : fans_.of(v)) add(target_.vertex_count() + j);
    }
  });
  return sums;
}

void WornPlaces::move_out(Positions& result) const {
  const Index count = outside_->count();
  Shifts shifts{Rows::Zero(count, 4), Positions::Zero(count, 3),
                std::vector<double>(static_cast<size_t>(count), 0.0)};
  for (int round = 0; round < kSmoothRounds + kSingleRounds && look(result, shifts); ++round) {
    // Of what is to be moved about each vertex the mean, and how much of a say that has.
    Rows wanted = gathered(shifts.rows);
    const double slight = round < kSmoothRounds ? kSlight * unit_ : 0;
    for (Index r = 0; r < wanted.rows(); ++r) {
      const double length = wanted(r, 3);
      if (length > 0) wanted.row(r) /= length + slight;
    }
    if (round < kSmoothRounds) {
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
  if (!outside_) return;
  outside_->take(placed(pose), pool_);
  move_out(result);
}

}  // namespace dd
