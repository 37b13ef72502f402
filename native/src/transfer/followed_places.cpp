// SPDX-License-Identifier: GPL-3.0-or-later
#include "transfer/followed_places.h"

#include <algorithm>
#include <utility>

#include "mesh/triangles.h"
#include "systems/operators.h"
#include "transfer/smoothing.h"

namespace dd {

namespace {

// As fractions of the diagonal of the target's box:
// The smoothing length that splits the difference of shape ō from the detail d, see the class.
constexpr double kDetailLength = 0.015;
// τ: ‖(S − M) ō‖ that halves a correction's weight. A larger one follows the source's places more
// often, a smaller one the gradients.
constexpr double kShapeTolerance = 0.003;
constexpr double kContactReach = 0.005;  // reach of contacts

// RMS deviation of a part's gradients from their mean at which half of its correction is a shift.
constexpr double kStiffDeviation = 0.02;
constexpr int kClosingRounds = 3;  // rounds of closing contacts, one solve each

}  // namespace

FollowedPlaces::FollowedPlaces(const TransferContext& context, const Progress& progress)
    : target_(*context.target),
      placement_(*context.placement),
      gradients_(*context.gradients),
      pool_(*context.pool),
      fans_(target_.triangles, target_.vertex_count()),
      points_(*context.points),
      shape_tolerance_(kShapeTolerance * context.box->scale) {
  const Region region = add_parts(*context.components);
  if (triangles_.empty()) return;
  const Positions unit = context.box->into(target_.positions);
  const SurfaceOperators operators = surface_operators(unit, target_.triangles);
  measure(operators.metric.areas, region);
  const SparseMatrix laplacian = free_block(operators.laplacian, region);
  Smoothing smoothing(laplacian, region, unit, masses_, pool_);

  rest_positions_ = positions_of_source(context.source->positions);
  find_offsets(kContactReach * context.box->scale);
  // Smoothed twice, so that short waves fall with the fourth power of their length.
  const std::unique_ptr<SparseCholesky> detail_factor =
      smoothing.factored(kDetailLength, Precision::full, within(progress, 0, 0.5));
  const auto smoothed = [&](const RowMatrix& values) {
    return detail_factor->solve(masses_.asDiagonal() * values, &pool_);
  };
  shape_ = smoothed(smoothed(detail_));
  detail_ -= shape_;
  factor_ = smoothing.factored(kSmoothingLength, context.precision, within(progress, 0.5, 1));
}

Region FollowedPlaces::add_parts(const std::vector<Component>& components) {
  std::vector<int> roles(static_cast<size_t>(target_.vertex_count()), kFixed);
  const auto follows = [](const Component& component) {
    return !component.held && !component.triangles.empty();
  };
  for (const Component& component : components)
    if (follows(component))
      for (int v : component.vertices) roles[v] = kFree;
  Region region = region_of_roles(std::move(roles), 0);
  vertices_ = region.free;
  for (const Component& component : components)
    if (follows(component)) add_part(component, region);
  return region;
}

void FollowedPlaces::measure(const Eigen::VectorXd& areas, const Region& region) {
  areas_.resize(static_cast<Index>(triangles_.size()));
  masses_ = Eigen::VectorXd::Zero(region.free_count());
  for (Index i = 0; i < areas_.size(); ++i) {
    const int j = triangles_[size_t(i)];
    areas_[i] = areas[j];
    for (int k = 0; k < 3; ++k)
      masses_[region.row[size_t(target_.triangles(j, k))]] += areas_[i] / 3;
  }
  // With the least mass, vertices without area or source take the smooth part of their neighbours.
  masses_ = masses_.cwiseMax(kMinRelativeMass * masses_.mean());
}

void FollowedPlaces::find_offsets(double contact_reach) {
  part_of_row_.resize(vertices_.size());
  std::vector<int> known_part(vertices_.size(), -1);
  detail_ = Positions::Zero(Index(vertices_.size()), 3);
  for (size_t i = 0; i < parts_.size(); ++i)
    for (int r : parts_[i].rows) {
      part_of_row_[size_t(r)] = static_cast<int>(i);
      const int v = vertices_[size_t(r)];
      if (!points_.is_known(v)) continue;
      known_part[size_t(r)] = static_cast<int>(i);
      detail_.row(r) = target_.positions.row(v) - rest_positions_.row(r);
    }
  compute_means();
  contacts_ =
      std::make_unique<Contacts>(rest_positions_, std::move(known_part), masses_, contact_reach);
}

void FollowedPlaces::add_part(const Component& component, const Region& region) {
  FollowedPart part;
  for (int j : component.triangles) {
    part.triangles.push_back(static_cast<int>(triangles_.size()));
    triangles_.push_back(j);
    row_of_triangle_.push_back(region.row[size_t(target_.triangles(j, 0))]);
  }
  for (int v : component.vertices) part.rows.push_back(region.row[size_t(v)]);
  parts_.push_back(std::move(part));
}

void FollowedPlaces::compute_means() {
  std::vector<size_t> triangle_counts, row_counts;
  for (FollowedPart& part : parts_) {
    for (int i : part.triangles) part.area += areas_[i];
    for (int r : part.rows) {
      if (!points_.is_known(vertices_[size_t(r)])) continue;
      part.mass += masses_[r];
      part.mean_source_position += masses_[r] * rest_positions_.row(r).transpose();
      part.mean_offset += masses_[r] * detail_.row(r).transpose();
    }
    if (part.mass > 0) part.mean_source_position /= part.mass, part.mean_offset /= part.mass;
    triangle_counts.push_back(part.triangles.size());
    row_counts.push_back(part.rows.size());
  }
  triangle_sums_ = PartSums(triangle_counts);
  row_sums_ = PartSums(row_counts);
}

FollowedPlaces::AffineMotion FollowedPlaces::least_deforming_motion(
    const Positions& source_positions, std::vector<PartMotion>& parts) const {
  struct GradientSum {
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    void operator+=(const GradientSum& other) { sum += other.sum; }
  };
  const auto gradient = [&](int i) -> const Eigen::Matrix3d& {
    return gradients_.at(triangles_[size_t(i)]);
  };
  const std::vector<GradientSum> gradient_sums =
      triangle_sums_.of<GradientSum>(pool_, [&](GradientSum& partial, size_t part, size_t k) {
        const int i = parts_[part].triangles[k];
        partial.sum += areas_[i] * gradient(i);
      });
  GradientSum all;
  parts.clear();
  for (size_t i = 0; i < gradient_sums.size(); ++i) {
    all += gradient_sums[i];
    parts.push_back({gradient_sums[i].sum, 0});
    if (parts_[i].area > 0) parts.back().mean_gradient /= parts_[i].area;
  }
  const Eigen::Matrix3d mean = all.sum / areas_.sum();

  struct StillSums {
    Eigen::Matrix3d gradients = Eigen::Matrix3d::Zero();
    Eigen::Vector3d posed_positions = Eigen::Vector3d::Zero(), rest_positions = posed_positions;
    double weight = 0, deviation = 0;
    void operator+=(const StillSums& other) {
      gradients += other.gradients;
      posed_positions += other.posed_positions;
      rest_positions += other.rest_positions;
      weight += other.weight;
      deviation += other.deviation;
    }
  };
  const std::vector<StillSums> still_sums =
      triangle_sums_.of<StillSums>(pool_, [&](StillSums& partial, size_t part, size_t k) {
        const int i = parts_[part].triangles[k], r = row_of_triangle_[size_t(i)];
        const Eigen::Matrix3d& S = gradient(i);
        const double weight = areas_[i] * stillness(S, mean);
        partial.gradients += weight * S;
        partial.posed_positions += weight * source_positions.row(r).transpose();
        partial.rest_positions += weight * rest_positions_.row(r).transpose();
        partial.weight += weight;
        partial.deviation += areas_[i] * (S - parts[part].mean_gradient).squaredNorm();
      });
  StillSums sum;
  for (size_t i = 0; i < still_sums.size(); ++i) {
    parts[i].deviation = still_sums[i].deviation;
    sum += still_sums[i];
  }
  AffineMotion motion;
  motion.linear = sum.gradients / sum.weight;
  motion.shift = (sum.posed_positions - motion.linear * sum.rest_positions) / sum.weight;
  return motion;
}

Positions FollowedPlaces::positions_of_source(const Positions& pose) const {
  Positions source_positions = Positions::Zero(static_cast<Index>(vertices_.size()), 3);
  pool_.parallel_for(source_positions.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (Index r = begin; r < end; ++r)
      if (points_.is_known(vertices_[size_t(r)]))
        source_positions.row(r) = placement_(points_.at(pose, vertices_[size_t(r)])).transpose();
  });
  return source_positions;
}

Eigen::RowVector3d FollowedPlaces::weighted_residual(Index r, const Positions& source_positions,
                                                     const Eigen::Matrix3d& M,
                                                     const Positions& result) const {
  const int v = vertices_[size_t(r)];
  if (!points_.is_known(v)) return Eigen::RowVector3d::Zero();
  const Eigen::Matrix3d S = gradients_.mean_of(fans_.of(v));
  const Eigen::Vector3d shape = shape_.row(r).transpose();
  const double relative_square =
      ((S - M) * shape).squaredNorm() / (shape_tolerance_ * shape_tolerance_);
  const Eigen::Vector3d carried = S * detail_.row(r).transpose() + M * shape;
  return (source_positions.row(r) + carried.transpose() - result.row(v)) /
         (1 + relative_square * relative_square);
}

std::vector<FollowedPlaces::PartShift> FollowedPlaces::part_shifts(
    const std::vector<PartMotion>& motions, const Positions& source_positions,
    const AffineMotion& still_motion, const Positions& result) const {
  struct PositionSums {
    Eigen::RowVector3d source_mean = Eigen::RowVector3d::Zero(), result_mean = source_mean;
    void operator+=(const PositionSums& other) {
      source_mean += other.source_mean;
      result_mean += other.result_mean;
    }
  };
  const std::vector<PositionSums> sums =
      row_sums_.of<PositionSums>(pool_, [&](PositionSums& sum, size_t part, size_t k) {
        const int r = parts_[part].rows[k], v = vertices_[size_t(r)];
        if (!points_.is_known(v)) return;
        sum.source_mean += masses_[r] * source_positions.row(r);
        sum.result_mean += masses_[r] * result.row(v);
      });
  std::vector<PartShift> found(parts_.size());
  for (size_t i = 0; i < parts_.size(); ++i) {
    const FollowedPart& part = parts_[i];
    if (!(part.area > 0 && part.mass > 0)) continue;
    const Eigen::Vector3d source_mean = sums[i].source_mean.transpose() / part.mass,
                          result_mean = sums[i].result_mean.transpose() / part.mass;
    const Eigen::Vector3d offset_change =
        (motions[i].mean_gradient - still_motion.linear) * part.mean_offset;
    const double squared_travel =
        (source_mean - still_motion.linear * part.mean_source_position - still_motion.shift)
            .squaredNorm();
    double relative_square = offset_change.squaredNorm() / (shape_tolerance_ * shape_tolerance_);
    if (relative_square > 0)
      relative_square *= squared_travel / (squared_travel + offset_change.squaredNorm());
    found[i].shift =
        (source_mean + still_motion.linear * part.mean_offset - result_mean).transpose() /
        (1 + relative_square * relative_square);
    found[i].rigid_fraction =
        1 / (1 + motions[i].deviation / (part.area * kStiffDeviation * kStiffDeviation));
  }
  return found;
}

void FollowedPlaces::close_contacts(const Positions& source_positions, Positions& result) {
  if (!contacts_->find_closing(source_positions, pool_)) return;
  Positions placed(source_positions.rows(), 3);
  for (Index r = 0; r < placed.rows(); ++r) placed.row(r) = result.row(vertices_[size_t(r)]);
  for (int round = 0; round < kClosingRounds; ++round) {
    const Rows displacements = contacts_->closing_displacements(source_positions, placed, pool_);
    // x holds the smoothed displacement and the smoothed indicator of the vertices that have one.
    // Their quotient moves even the narrow rim of a gap all the way.
    factor_->solve_rows([&](int r) { return masses_[r] * displacements.row(r); },
                        [&](int r, const auto* x) {
                          const double indicator = std::max(double(x[3]), kMinSmoothedIndicator);
                          for (int c = 0; c < 3; ++c) placed(r, c) += x[c] / indicator;
                        },
                        space_, &pool_);
  }
  for (Index r = 0; r < placed.rows(); ++r) result.row(vertices_[size_t(r)]) = placed.row(r);
}

void FollowedPlaces::correct(const Positions& pose, Positions& result) {
  if (!factor_) return;
  const Positions source_positions = positions_of_source(pose);
  std::vector<PartMotion> motions;
  const AffineMotion still_motion = least_deforming_motion(source_positions, motions);
  const std::vector<PartShift> shifts_of_parts =
      part_shifts(motions, source_positions, still_motion, result);
  // In row order, as gradients would be read at random in the factor's order.
  Rows weighted_residuals = Rows::Zero(source_positions.rows(), 4);
  pool_.parallel_for(weighted_residuals.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (Index r = begin; r < end; ++r)
      weighted_residuals.row(r).head<3>() =
          masses_[r] * weighted_residual(r, source_positions, still_motion.linear, result);
  });
  factor_->solve_rows(
      [&](int r) { return weighted_residuals.row(r); },
      [&](int r, const auto* x) {
        const PartShift& part_shift = shifts_of_parts[size_t(part_of_row_[size_t(r)])];
        const int v = vertices_[size_t(r)];
        for (int c = 0; c < 3; ++c)
          result(v, c) += x[c] + part_shift.rigid_fraction * (part_shift.shift[c] - x[c]);
      },
      space_, &pool_, Columns::three);
  close_contacts(source_positions, result);
}

}  // namespace dd
