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
constexpr double kDetail = 0.015;  // smoothing length that splits ō from d
// τ: ‖(S − M) ō‖ that halves a correction's weight. A larger one follows the source's places more
// often, a smaller one the gradients.
constexpr double kDifferent = 0.003;
constexpr double kContactReach = 0.005;  // reach of contacts

// RMS deviation of a part's gradients from their mean at which half of its correction is a shift.
constexpr double kStiff = 0.02;
constexpr int kClosings = 3;  // rounds of closing contacts, one solve each

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

  // With the least mass, vertices without area or source take the smooth part of their neighbours.
  masses_ = masses_.cwiseMax(kLeastMass * masses_.mean());

  const SparseMatrix laplacian = free_block(operators.laplacian, region);
  Smoothing smoothing(laplacian, region, unit, masses_, pool_);

  rest_places_ = places_of_source(source.positions);
  part_of_row_.resize(vertices_.size());
  std::vector<int> known_part(vertices_.size(), -1);
  detail_ = Positions::Zero(region.free_count(), 3);
  for (size_t i = 0; i < parts_.size(); ++i)
    for (int r : parts_[i].rows) {
      part_of_row_[size_t(r)] = static_cast<int>(i);
      const int v = vertices_[size_t(r)];
      if (!points_.is_known(v)) continue;
      known_part[size_t(r)] = static_cast<int>(i);
      detail_.row(r) = target.positions.row(v) - rest_places_.row(r);
    }
  find_means();
  contacts_ = std::make_unique<Contacts>(rest_places_, std::move(known_part), masses_,
                                         kContactReach * box.scale);
  // Smoothed twice, so that short waves fall with the fourth power of their length.
  const std::unique_ptr<SparseCholesky> of_detail =
      smoothing.factored(kDetail, Precision::full, within(progress, 0, 0.5));
  const auto smoothed = [&](const RowMatrix& values) {
    return of_detail->solve(masses_.asDiagonal() * values, &pool_);
  };
  shape_ = smoothed(smoothed(detail_));
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

void FollowedPlaces::find_means() {
  std::vector<size_t> triangle_counts, row_counts;
  for (Part& part : parts_) {
    for (int i : part.triangles) part.area += areas_[i];
    for (int r : part.rows) {
      if (!points_.is_known(vertices_[size_t(r)])) continue;
      part.mass += masses_[r];
      part.before += masses_[r] * rest_places_.row(r).transpose();
      part.between += masses_[r] * detail_.row(r).transpose();
    }
    if (part.mass > 0) part.before /= part.mass, part.between /= part.mass;
    triangle_counts.push_back(part.triangles.size());
    row_counts.push_back(part.rows.size());
  }
  over_triangles_ = PartSums(triangle_counts);
  over_rows_ = PartSums(row_counts);
}

FollowedPlaces::Motion FollowedPlaces::still_motion(const Positions& places,
                                                    std::vector<PartMotion>& parts) const {
  struct Turns {
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    void operator+=(const Turns& other) { sum += other.sum; }
  };
  const auto gradient = [&](int i) -> const Eigen::Matrix3d& {
    return gradients_.at(triangles_[size_t(i)]);
  };
  const std::vector<Turns> turns =
      over_triangles_.of<Turns>(pool_, [&](Turns& turn, size_t part, size_t k) {
        const int i = parts_[part].triangles[k];
        turn.sum += areas_[i] * gradient(i);
      });
  Turns all;
  parts.clear();
  for (size_t i = 0; i < turns.size(); ++i) {
    all += turns[i];
    parts.push_back({turns[i].sum, 0});
    if (parts_[i].area > 0) parts.back().turn /= parts_[i].area;
  }
  const Eigen::Matrix3d mean = all.sum / areas_.sum();

  struct Still {
    Eigen::Matrix3d turns = Eigen::Matrix3d::Zero();
    Eigen::Vector3d there = Eigen::Vector3d::Zero(), before = there;
    double weight = 0, spread = 0;
    void operator+=(const Still& other) {
      turns += other.turns;
      there += other.there;
      before += other.before;
      weight += other.weight;
      spread += other.spread;
    }
  };
  const std::vector<Still> stills =
      over_triangles_.of<Still>(pool_, [&](Still& still, size_t part, size_t k) {
        const int i = parts_[part].triangles[k], r = row_of_triangle_[size_t(i)];
        const Eigen::Matrix3d& S = gradient(i);
        const double weight = areas_[i] * stillness(S, mean);
        still.turns += weight * S;
        still.there += weight * places.row(r).transpose();
        still.before += weight * rest_places_.row(r).transpose();
        still.weight += weight;
        still.spread += areas_[i] * (S - parts[part].turn).squaredNorm();
      });
  Still sum;
  for (size_t i = 0; i < stills.size(); ++i) {
    parts[i].spread = stills[i].spread;
    sum += stills[i];
  }
  Motion motion;
  motion.linear = sum.turns / sum.weight;
  motion.shift = (sum.there - motion.linear * sum.before) / sum.weight;
  return motion;
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

Eigen::RowVector3d FollowedPlaces::missing(Index r, const Positions& places,
                                           const Eigen::Matrix3d& M,
                                           const Positions& result) const {
  const int v = vertices_[size_t(r)];
  if (!points_.is_known(v)) return Eigen::RowVector3d::Zero();
  const Eigen::Matrix3d S = gradients_.mean_of(fans_.of(v));
  const Eigen::Vector3d shape = shape_.row(r).transpose();
  const double doubt = ((S - M) * shape).squaredNorm() / (different_ * different_);
  const Eigen::Vector3d carried = S * detail_.row(r).transpose() + M * shape;
  return (places.row(r) + carried.transpose() - result.row(v)) / (1 + doubt * doubt);
}

std::vector<FollowedPlaces::Stiffness> FollowedPlaces::stiffened(
    const std::vector<PartMotion>& motions, const Positions& places, const Motion& still,
    const Positions& result) const {
  struct Places {
    Eigen::RowVector3d there = Eigen::RowVector3d::Zero(), here = there;
    void operator+=(const Places& other) {
      there += other.there;
      here += other.here;
    }
  };
  const std::vector<Places> sums =
      over_rows_.of<Places>(pool_, [&](Places& sum, size_t part, size_t k) {
        const int r = parts_[part].rows[k], v = vertices_[size_t(r)];
        if (!points_.is_known(v)) return;
        sum.there += masses_[r] * places.row(r);
        sum.here += masses_[r] * result.row(v);
      });
  std::vector<Stiffness> found(parts_.size());
  for (size_t i = 0; i < parts_.size(); ++i) {
    const Part& part = parts_[i];
    if (!(part.area > 0 && part.mass > 0)) continue;
    const Eigen::Vector3d there = sums[i].there.transpose() / part.mass,
                          here = sums[i].here.transpose() / part.mass;
    const Eigen::Vector3d swing = (motions[i].turn - still.linear) * part.between;
    const double way = (there - still.linear * part.before - still.shift).squaredNorm();
    double doubt = swing.squaredNorm() / (different_ * different_);
    if (doubt > 0) doubt *= way / (way + swing.squaredNorm());
    found[i].shift = (there + still.linear * part.between - here).transpose() / (1 + doubt * doubt);
    found[i].share = 1 / (1 + motions[i].spread / (part.area * kStiff * kStiff));
  }
  return found;
}

void FollowedPlaces::close(const Positions& places, Positions& result) {
  if (!contacts_->take(places, pool_)) return;
  Positions placed(places.rows(), 3);
  for (Index r = 0; r < placed.rows(); ++r) placed.row(r) = result.row(vertices_[size_t(r)]);
  for (int round = 0; round < kClosings; ++round) {
    const Rows missing = contacts_->missing(places, placed, pool_);
    // Divided by the smoothed weights, so that a gap's narrow rim is moved all the way.
    factor_->solve_rows([&](int r) { return masses_[r] * missing.row(r); },
                        [&](int r, const auto* x) {
                          const double share = std::max(double(x[3]), kEdge);
                          for (int c = 0; c < 3; ++c) placed(r, c) += x[c] / share;
                        },
                        space_, &pool_);
  }
  for (Index r = 0; r < placed.rows(); ++r) result.row(vertices_[size_t(r)]) = placed.row(r);
}

void FollowedPlaces::correct(const Positions& pose, Positions& result) {
  if (!factor_) return;
  const Positions places = places_of_source(pose);
  std::vector<PartMotion> motions;
  const Motion still = still_motion(places, motions);
  const std::vector<Stiffness> stiff = stiffened(motions, places, still, result);
  // In row order, as gradients would be read at random in the factor's order.
  Rows wanted = Rows::Zero(places.rows(), 4);
  pool_.parallel_for(wanted.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (Index r = begin; r < end; ++r)
      wanted.row(r).head<3>() = masses_[r] * missing(r, places, still.linear, result);
  });
  factor_->solve_rows([&](int r) { return wanted.row(r); },
                      [&](int r, const auto* x) {
                        const Stiffness& of_part = stiff[size_t(part_of_row_[size_t(r)])];
                        const int v = vertices_[size_t(r)];
                        for (int c = 0; c < 3; ++c)
                          result(v, c) += x[c] + of_part.share * (of_part.shift[c] - x[c]);
                      },
                      space_, &pool_, Columns::three);
  close(places, result);
}

}  // namespace dd
