// SPDX-License-Identifier: GPL-3.0-or-later
#include "transfer/followed_places.h"

#include <utility>

#include "mesh/triangles.h"
#include "systems/free_block.h"
#include "systems/operators.h"

namespace dd {

namespace {

// Of the box.
constexpr double kSmooth = 0.01;      // ℓ
constexpr double kDetail = 0.015;     // ℓ of what tells a difference of shape from detail
constexpr double kDifferent = 0.003;  // τ
constexpr double kReach = 0.005;      // of contacts

constexpr double kStiff = 0.02;  // spread of gradients in a part that as good as doesn't deform
constexpr double kEdge = 0.25;   // share of a contact's weight that smoothing leaves, at least
constexpr int kRounds = 2;       // of closing

}  // namespace

FollowedPlaces::FollowedPlaces(const Mesh& source, const Mesh& target, const UnitBox& box,
                               const std::vector<Component>& components,
                               const Similarity& placement, const SourceGradients& gradients,
                               Precision precision, ThreadPool& pool, const Progress& progress)
    : placement_(placement),
      gradients_(gradients),
      pool_(pool),
      fans_(target.triangles, target.vertex_count()),
      points_(source, target, fans_, gradients, placement, pool),
      different_(kDifferent * box.scale) {
  std::vector<int> roles(static_cast<size_t>(target.vertex_count()), kFixed);
  const auto follows = [](const Component& component) {
    return !component.held && !component.triangles.empty();
  };
  for (const Component& component : components)
    if (follows(component))
      for (int v : component.vertices) roles[v] = kFree;
  const Region region = region_of(std::move(roles), 0);
  vertices_ = region.free;
  for (const Component& component : components)
    if (follows(component)) add(component, region);
  if (triangles_.empty()) return;

  const Positions unit = box.into(target.positions);
  const SurfaceOperators operators = surface_operators(unit, target.triangles);
  areas_.resize(static_cast<Index>(triangles_.size()));
  masses_ = Eigen::VectorXd::Zero(region.free_count());
  for (Index i = 0; i < areas_.size(); ++i) {
    const int j = triangles_[size_t(i)];
    areas_[i] = operators.metric.areas[j];
    for (int k = 0; k < 3; ++k)
      masses_[region.row[size_t(target.triangles(j, k))]] += areas_[i] / 3;
  }

  const SparseMatrix laplacian = free_block(operators.laplacian, region);
  const Dissection dissection = free_dissection(laplacian, region, unit, &pool_);
  std::shared_ptr<const SymbolicCholesky> symbolic;
  const auto factored = [&](double length, Precision kept) {
    SparseMatrix block = length * length * laplacian;
    for (int r = 0; r < region.free_count(); ++r) block.coeffRef(r, r) += masses_[r];
    BlockOptions how;
    how.pool = &pool_;
    how.precision = kept;
    how.dissection = symbolic ? nullptr : &dissection;
    how.symbolic = symbolic;
    how.progress = within(progress, symbolic ? 0.5 : 0, symbolic ? 1 : 0.5);
    auto factor = std::make_unique<SparseCholesky>(factor_free_block(block, region, how));
    symbolic = factor->shared_symbolic();
    return factor;
  };

  const Positions places = places_of_source(source.positions);
  std::vector<int> part_of(vertices_.size(), -1);
  detail_ = Positions::Zero(region.free_count(), 3);
  for (size_t i = 0; i < parts_.size(); ++i)
    for (int r : parts_[i].rows) {
      const int v = vertices_[size_t(r)];
      if (!points_.is_known(v)) continue;
      part_of[size_t(r)] = static_cast<int>(i);
      detail_.row(r) = target.positions.row(v) - places.row(r);
    }
  contacts_ = std::make_unique<Contacts>(places, std::move(part_of), kReach * box.scale);
  // Twice: what is left of a wave falls with the fourth power of its length.
  const std::unique_ptr<SparseCholesky> of_detail = factored(kDetail, Precision::full);
  shape_ = smooth(*of_detail, smooth(*of_detail, detail_));
  detail_ -= shape_;
  factor_ = factored(kSmooth, precision);
}

void FollowedPlaces::add(const Component& component, const Region& region) {
  Part part;
  for (int j : component.triangles) {
    part.triangles.push_back(static_cast<int>(triangles_.size()));
    triangles_.push_back(j);
  }
  for (int v : component.vertices) part.rows.push_back(region.row[size_t(v)]);
  parts_.push_back(std::move(part));
}

RowMatrix FollowedPlaces::smooth(const SparseCholesky& factor, const RowMatrix& values) const {
  return factor.solve(masses_.asDiagonal() * values, &pool_);
}

Eigen::Matrix3d FollowedPlaces::still_gradient() const {
  Eigen::Matrix3d mean = Eigen::Matrix3d::Zero(), still = mean;
  for (Index i = 0; i < areas_.size(); ++i)
    mean += areas_[i] * gradients_.at(triangles_[size_t(i)]);
  mean /= areas_.sum();
  double sum = 0;
  for (Index i = 0; i < areas_.size(); ++i) {
    const Eigen::Matrix3d& S = gradients_.at(triangles_[size_t(i)]);
    const double weight = areas_[i] * stillness(S, mean);
    still += weight * S;
    sum += weight;
  }
  return still / sum;
}

Positions FollowedPlaces::places_of_source(const Positions& pose) const {
  Positions places = Positions::Zero(static_cast<Index>(vertices_.size()), 3);
  pool_.parallel_for(places.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (Index r = begin; r < end; ++r)
      if (points_.is_known(vertices_[size_t(r)]))
        places.row(r) = placement_(points_.at(pose, vertices_[size_t(r)])).transpose();
  });
  return places;
}

RowMatrix FollowedPlaces::missing(const Positions& places, const Positions& result) const {
  const Eigen::Matrix3d M = still_gradient();
  RowMatrix missing = RowMatrix::Zero(places.rows(), 3);
  pool_.parallel_for(missing.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (Index r = begin; r < end; ++r) {
      const int v = vertices_[size_t(r)];
      if (!points_.is_known(v)) continue;
      Eigen::Matrix3d S = Eigen::Matrix3d::Zero();
      int count = 0;
      for (int j : fans_.of(v)) {
        S += gradients_.at(j);
        ++count;
      }
      S /= count;
      const Eigen::Vector3d shape = shape_.row(r).transpose();
      const double doubt = ((S - M) * shape).squaredNorm() / (different_ * different_);
      const Eigen::Vector3d carried = S * detail_.row(r).transpose() + M * shape;
      missing.row(r) = (places.row(r) + carried.transpose() - result.row(v)) / (1 + doubt * doubt);
    }
  });
  return missing;
}

void FollowedPlaces::stiffen(const Part& part, const RowMatrix& missing, RowMatrix& moved) const {
  Eigen::Matrix3d mean = Eigen::Matrix3d::Zero();
  double area = 0, spread = 0;
  for (int i : part.triangles) {
    mean += areas_[i] * gradients_.at(triangles_[size_t(i)]);
    area += areas_[i];
  }
  if (!(area > 0)) return;
  mean /= area;
  for (int i : part.triangles)
    spread += areas_[i] * (gradients_.at(triangles_[size_t(i)]) - mean).squaredNorm();
  const double share = 1 / (1 + spread / (area * kStiff * kStiff));
  Eigen::RowVector3d shift = Eigen::RowVector3d::Zero();
  double mass = 0;
  for (int r : part.rows) {
    shift += masses_[r] * missing.row(r);
    mass += masses_[r];
  }
  if (!(mass > 0)) return;
  for (int r : part.rows) moved.row(r) += share * (shift / mass - moved.row(r));
}

void FollowedPlaces::close(const Positions& places, Positions& result) {
  if (!contacts_->take(places, pool_)) return;
  Positions placed(places.rows(), 3);
  for (int round = 0; round < kRounds; ++round) {
    for (Index r = 0; r < placed.rows(); ++r) placed.row(r) = result.row(vertices_[size_t(r)]);
    // Divided by the smooth part of the weights, what closes is moved wholly though it is a rim.
    const RowMatrix smoothed = smooth(*factor_, contacts_->missing(places, placed));
    for (Index r = 0; r < smoothed.rows(); ++r)
      result.row(vertices_[size_t(r)]) +=
          smoothed.row(r).head<3>() / std::max(smoothed(r, 3), kEdge);
  }
}

void FollowedPlaces::correct(const Positions& pose, Positions& result) {
  if (!factor_) return;
  const Positions places = places_of_source(pose);
  const RowMatrix needed = missing(places, result);
  RowMatrix moved = smooth(*factor_, needed);
  for (const Part& part : parts_) stiffen(part, needed, moved);
  for (Index r = 0; r < moved.rows(); ++r) result.row(vertices_[size_t(r)]) += moved.row(r);
  close(places, result);
}

}  // namespace dd
