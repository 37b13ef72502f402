// SPDX-License-Identifier: GPL-3.0-or-later
#include "transfer/followed_places.h"

#include <utility>

#include "mesh/triangles.h"
#include "systems/operators.h"
#include "transfer/smoothing.h"

namespace dd {

namespace {

// Of the box.
constexpr double kDetail = 0.015;     // ℓ of what tells a difference of shape from detail
constexpr double kDifferent = 0.003;  // τ
constexpr double kReach = 0.005;      // of contacts

constexpr double kStiff = 0.02;  // spread of gradients in a part that as good as doesn't deform
constexpr int kClosings = 3;     // of closing

}  // namespace

FollowedPlaces::FollowedPlaces(const Mesh& source, const Mesh& target, const UnitBox& box,
                               const std::vector<Component>& components, const SourcePoints& points,
                               const Similarity& placement, const SourceGradients& gradients,
                               Precision precision, ThreadPool& pool, const Progress& progress)
    : placement_(placement),
      gradients_(gradients),
      pool_(pool),
      fans_(target.triangles, target.vertex_count()),
      points_(points),
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
    if (follows(component)) add(component, region, target.triangles);
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

  // Where no triangle has an area, or none has a source, the smooth part is that of its neighbours.
  masses_ = masses_.cwiseMax(kLeastMass * masses_.mean());

  const SparseMatrix laplacian = free_block(operators.laplacian, region);
  Smoothing smoothing(laplacian, region, unit, masses_, pool_);

  rest_places_ = places_of_source(source.positions);
  std::vector<int> part_of(vertices_.size(), -1);
  detail_ = Positions::Zero(region.free_count(), 3);
  for (size_t i = 0; i < parts_.size(); ++i)
    for (int r : parts_[i].rows) {
      const int v = vertices_[size_t(r)];
      if (!points_.is_known(v)) continue;
      part_of[size_t(r)] = static_cast<int>(i);
      detail_.row(r) = target.positions.row(v) - rest_places_.row(r);
    }
  contacts_ =
      std::make_unique<Contacts>(rest_places_, std::move(part_of), masses_, kReach * box.scale);
  // Twice: what is left of a wave falls with the fourth power of its length.
  const std::unique_ptr<SparseCholesky> of_detail =
      smoothing.factored(kDetail, Precision::full, within(progress, 0, 0.5));
  shape_ = smooth(*of_detail, smooth(*of_detail, detail_));
  detail_ -= shape_;
  factor_ = smoothing.factored(kSmooth, precision, within(progress, 0.5, 1));
}

void FollowedPlaces::add(const Component& component, const Region& region,
                         const Triangles& corners) {
  Part part;
  for (int j : component.triangles) {
    part.triangles.push_back(static_cast<int>(triangles_.size()));
    triangles_.push_back(j);
    row_of_triangle_.push_back(region.row[size_t(corners(j, 0))]);
  }
  for (int v : component.vertices) part.rows.push_back(region.row[size_t(v)]);
  parts_.push_back(std::move(part));
}

RowMatrix FollowedPlaces::smooth(const SparseCholesky& factor, const RowMatrix& values) const {
  return factor.solve(masses_.asDiagonal() * values, &pool_);
}

FollowedPlaces::Motion FollowedPlaces::still_motion(const Positions& places) const {
  Eigen::Matrix3d mean = Eigen::Matrix3d::Zero();
  for (Index i = 0; i < areas_.size(); ++i)
    mean += areas_[i] * gradients_.at(triangles_[size_t(i)]);
  mean /= areas_.sum();
  Motion still{Eigen::Matrix3d::Zero(), Eigen::Vector3d::Zero()};
  std::vector<double> weights;
  double sum = 0;
  for (Index i = 0; i < areas_.size(); ++i) {
    const Eigen::Matrix3d& S = gradients_.at(triangles_[size_t(i)]);
    weights.push_back(areas_[i] * stillness(S, mean));
    still.linear += weights.back() * S;
    sum += weights.back();
  }
  still.linear /= sum;
  for (size_t i = 0; i < weights.size(); ++i) {
    const int r = row_of_triangle_[i];
    still.shift += weights[i] / sum *
                   (places.row(r).transpose() - still.linear * rest_places_.row(r).transpose());
  }
  return still;
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

RowMatrix FollowedPlaces::missing(const Positions& places, const Eigen::Matrix3d& M,
                                  const Positions& result) const {
  RowMatrix missing = RowMatrix::Zero(places.rows(), 3);
  pool_.parallel_for(missing.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (Index r = begin; r < end; ++r) {
      const int v = vertices_[size_t(r)];
      if (!points_.is_known(v)) continue;
      const Eigen::Matrix3d S = gradients_.mean_of(fans_.of(v));
      const Eigen::Vector3d shape = shape_.row(r).transpose();
      const double doubt = ((S - M) * shape).squaredNorm() / (different_ * different_);
      const Eigen::Vector3d carried = S * detail_.row(r).transpose() + M * shape;
      missing.row(r) = (places.row(r) + carried.transpose() - result.row(v)) / (1 + doubt * doubt);
    }
  });
  return missing;
}

void FollowedPlaces::stiffen(const Part& part, const Positions& places, const Motion& still,
                             const Positions& result, RowMatrix& moved) const {
  Eigen::Matrix3d S = Eigen::Matrix3d::Zero();
  double area = 0, spread = 0, mass = 0;
  for (int i : part.triangles) {
    S += areas_[i] * gradients_.at(triangles_[size_t(i)]);
    area += areas_[i];
  }
  if (!(area > 0)) return;
  S /= area;
  for (int i : part.triangles)
    spread += areas_[i] * (gradients_.at(triangles_[size_t(i)]) - S).squaredNorm();

  // Means over the part: of A(b'), of A(b), of what is between the meshes, and of p'.
  Eigen::Vector3d there = Eigen::Vector3d::Zero(), before = there, between = there, here = there;
  for (int r : part.rows) {
    if (!points_.is_known(vertices_[size_t(r)])) continue;
    mass += masses_[r];
    there += masses_[r] * places.row(r).transpose();
    before += masses_[r] * rest_places_.row(r).transpose();
    between += masses_[r] * (shape_.row(r) + detail_.row(r)).transpose();
    here += masses_[r] * result.row(vertices_[size_t(r)]).transpose();
  }
  if (!(mass > 0)) return;
  const Eigen::Vector3d swing = (S - still.linear) * between / mass;
  const double way = (there / mass - still.linear * before / mass - still.shift).squaredNorm();
  double doubt = swing.squaredNorm() / (different_ * different_);
  if (doubt > 0) doubt *= way / (way + swing.squaredNorm());
  const Eigen::Vector3d shift =
      (there + still.linear * between - here) / mass / (1 + doubt * doubt);
  const double share = 1 / (1 + spread / (area * kStiff * kStiff));
  for (int r : part.rows) moved.row(r) += share * (shift.transpose() - moved.row(r));
}

void FollowedPlaces::close(const Positions& places, Positions& result) {
  if (!contacts_->take(places, pool_)) return;
  Positions placed(places.rows(), 3);
  for (int round = 0; round < kClosings; ++round) {
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
  const Motion still = still_motion(places);
  RowMatrix moved = smooth(*factor_, missing(places, still.linear, result));
  for (const Part& part : parts_) stiffen(part, places, still, result, moved);
  for (Index r = 0; r < moved.rows(); ++r) result.row(vertices_[size_t(r)]) += moved.row(r);
  close(places, result);
}

}  // namespace dd
