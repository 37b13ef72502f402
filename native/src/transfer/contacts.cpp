// SPDX-License-Identifier: GPL-3.0-or-later
#include "transfer/contacts.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

namespace dd {

namespace {

// Length of a displacement that halves its weight, as a multiple of the reach.
constexpr double kHalvingReaches = 4;
constexpr int kPointRanges =
    64;  // ranges of points: fixed, so that results don't depend on the threads
constexpr int kCellsPerReach = 3;  // cells in a reach, each with one representative a part
// Later points that one is compared with; of a larger crowd only an even share. Bounds the time; a
// few sheets of representatives are fewer.
constexpr int kMaxComparedPoints = 250;

double smoothstep(double t) {
  t = std::clamp(t, 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

}  // namespace

Contacts::Contacts(Positions rest, std::vector<int> parts, const Eigen::VectorXd& masses,
                   double reach)
    : rest_(std::move(rest)),
      parts_(std::move(parts)),
      mass_ratio_(parts_.size(), 0.0),
      reach_(reach) {
  if (!(reach_ > 0)) return;
  std::vector<std::array<int64_t, 5>> by_cell;  // cell, part, point
  for (size_t i = 0; i < parts_.size(); ++i) {
    if (parts_[i] < 0) continue;
    const Cell cell = cell_at(rest_.row(Index(i)) - rest_.row(0), reach_ / kCellsPerReach);
    by_cell.push_back({cell.x, cell.y, cell.z, parts_[i], int64_t(i)});
  }
  std::sort(by_cell.begin(), by_cell.end());
  for (size_t k = 0; k < by_cell.size();) {
    const auto is_beside = [&](size_t other) {
      return std::equal(by_cell[k].begin(), by_cell[k].end() - 1, by_cell[other].begin());
    };
    const auto first = static_cast<size_t>(by_cell[k][4]);
    double mass = 0;
    size_t next = k;
    for (; next < by_cell.size() && is_beside(next); ++next) mass += masses[by_cell[next][4]];
    mass_ratio_[first] = masses[Index(first)] > 0 ? mass / masses[Index(first)] : 0;
    representatives_.push_back(static_cast<int>(first));
    k = next;
  }
  std::sort(representatives_.begin(), representatives_.end());
}

std::vector<int> Contacts::near_moving(const Positions& posed, ThreadPool& pool) const {
  // Where two points come nearer by reach / 2, at least one of them moves by reach / 4.
  std::vector<char> moves(representatives_.size());
  const auto count = static_cast<int64_t>(representatives_.size());
  pool.parallel_for(count, kLeastRange, [&](int64_t begin, int64_t end) {
    for (auto k = static_cast<size_t>(begin); k < static_cast<size_t>(end); ++k)
      moves[k] =
          (posed.row(representatives_[k]) - rest_.row(representatives_[k])).norm() > reach_ / 4;
  });
  Eigen::AlignedBox3d box;
  for (size_t k = 0; k < moves.size(); ++k)
    if (moves[k]) box.extend(posed.row(representatives_[k]).transpose());
  std::vector<int> near;
  if (box.isEmpty()) return near;
  const Eigen::RowVector3d low = box.min().transpose().array() - reach_,
                           high = box.max().transpose().array() + reach_;
  for (int i : representatives_)
    if ((posed.row(i).array() >= low.array()).all() && (posed.row(i).array() <= high.array()).all())
      near.push_back(i);
  return near;
}

std::vector<std::vector<Contacts::ClosingPair>> Contacts::closing_pairs(const PointGrid& grid,
                                                                        ThreadPool& pool) const {
  struct RestPoint {
    Eigen::RowVector3d rest;
    int part;
  };
  std::vector<RestPoint> rest_points(static_cast<size_t>(grid.count()));  // in the grid's order
  pool.parallel_for(grid.count(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (int k = static_cast<int>(begin); k < static_cast<int>(end); ++k)
      rest_points[size_t(k)] = {rest_.row(grid.point(k)), parts_[size_t(grid.point(k))]};
  });
  std::vector<std::vector<ClosingPair>> found(kPointRanges);
  pool.run(kPointRanges, [&](int range) {
    const auto bound = [&](int of) {
      return static_cast<int>(int64_t{grid.count()} * of / kPointRanges);
    };
    for (int k = bound(range); k < bound(range + 1); ++k)
      grid.near_after(k, kMaxComparedPoints, [&](int l, double squared) {
        const double rest =
            (rest_points[size_t(k)].rest - rest_points[size_t(l)].rest).squaredNorm();
        if (!(4 * squared < rest) || rest_points[size_t(k)].part != rest_points[size_t(l)].part)
          return;
        const double a = std::sqrt(rest), b = std::sqrt(squared);
        const double closeness = smoothstep(1 - b / reach_) * smoothstep(1 - 2 * b / a) *
                                 smoothstep(2 * (a - b) / reach_ - 1);
        if (closeness > 0)
          found[size_t(range)].push_back(
              {{grid.point(k), grid.point(l)}, static_cast<float>(closeness)});
      });
  });
  return found;
}

bool Contacts::find_closing(const Positions& posed, ThreadPool& pool) {
  const std::vector<int> near = near_moving(posed, pool);
  if (near.empty()) return false;
  const std::vector<std::vector<ClosingPair>> found =
      closing_pairs(PointGrid(posed, near, reach_, pool), pool);
  partner_begin_.assign(static_cast<size_t>(posed.rows()) + 1, 0);
  for (const std::vector<ClosingPair>& of_range : found)
    for (const ClosingPair& pair : of_range)
      for (int i : pair.points) ++partner_begin_[size_t(i) + 1];
  std::partial_sum(partner_begin_.begin(), partner_begin_.end(), partner_begin_.begin());
  partners_.resize(partner_begin_.back());
  std::vector<size_t> next(partner_begin_.begin(), partner_begin_.end() - 1);
  for (const std::vector<ClosingPair>& of_range : found)
    for (const ClosingPair& pair : of_range)
      for (int side = 0; side < 2; ++side)
        partners_[next[size_t(pair.points[side])]++] = {pair.points[1 - side], pair.closeness};
  return !partners_.empty();
}

Rows Contacts::closing_displacements(const Positions& posed, const Positions& placed,
                                     ThreadPool& pool) const {
  Rows result = Rows::Zero(posed.rows(), 4);
  const auto find = [&](Index i) {
    Eigen::RowVector3d sum = Eigen::RowVector3d::Zero();
    double closeness_sum = 0, largest = 0;
    for (size_t k = partner_begin_[size_t(i)]; k < partner_begin_[size_t(i) + 1]; ++k) {
      const ClosingPartner& partner = partners_[k];
      sum += partner.closeness * (posed.row(partner.point) - placed.row(partner.point));
      closeness_sum += partner.closeness;
      largest = std::max<double>(largest, partner.closeness);
    }
    if (!(closeness_sum > 0)) return;
    const Eigen::RowVector3d e = (posed.row(i) - placed.row(i) - sum / closeness_sum) / 2;
    const double relative_square =
        e.squaredNorm() / (kHalvingReaches * kHalvingReaches * reach_ * reach_);
    const double closeness =
        mass_ratio_[size_t(i)] * largest / (1 + relative_square * relative_square);
    result.row(i) << closeness * e, closeness;
  };
  pool.parallel_for(result.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (Index i = begin; i < end; ++i) find(i);
  });
  return result;
}

}  // namespace dd
