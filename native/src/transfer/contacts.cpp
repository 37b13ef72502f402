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
constexpr double kFarReaches = 4;
constexpr int kRanges = 64;  // ranges of points: fixed, so that results don't depend on the threads
constexpr int kDense = 3;    // cells in a reach, each with one representative a part
// Later points that one is compared with; of a larger crowd only an even share. Bounds the time; a
// few sheets of representatives are fewer.
constexpr int kCrowd = 250;

double risen(double t) {
  t = std::clamp(t, 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

}  // namespace

Contacts::Contacts(Positions rest, std::vector<int> parts, const Eigen::VectorXd& masses,
                   double reach)
    : rest_(std::move(rest)),
      parts_(std::move(parts)),
      stands_for_(parts_.size(), 0.0),
      reach_(reach) {
  if (!(reach_ > 0)) return;
  std::vector<std::array<int64_t, 5>> by_place;  // cell, part, point
  for (size_t i = 0; i < parts_.size(); ++i) {
    if (parts_[i] < 0) continue;
    const Cell cell = cell_at(rest_.row(Index(i)) - rest_.row(0), reach_ / kDense);
    by_place.push_back({cell.x, cell.y, cell.z, parts_[i], int64_t(i)});
  }
  std::sort(by_place.begin(), by_place.end());
  for (size_t k = 0; k < by_place.size();) {
    const auto is_beside = [&](size_t other) {
      return std::equal(by_place[k].begin(), by_place[k].end() - 1, by_place[other].begin());
    };
    const auto first = static_cast<size_t>(by_place[k][4]);
    double mass = 0;
    size_t next = k;
    for (; next < by_place.size() && is_beside(next); ++next) mass += masses[by_place[next][4]];
    stands_for_[first] = masses[Index(first)] > 0 ? mass / masses[Index(first)] : 0;
    chosen_.push_back(static_cast<int>(first));
    k = next;
  }
  std::sort(chosen_.begin(), chosen_.end());
}

std::vector<int> Contacts::near_what_moves(const Positions& posed, ThreadPool& pool) const {
  // Where two points come nearer by reach / 2, at least one of them moves by reach / 4.
  std::vector<char> moves(chosen_.size());
  const auto count = static_cast<int64_t>(chosen_.size());
  pool.parallel_for(count, kLeastRange, [&](int64_t begin, int64_t end) {
    for (auto k = static_cast<size_t>(begin); k < static_cast<size_t>(end); ++k)
      moves[k] = (posed.row(chosen_[k]) - rest_.row(chosen_[k])).norm() > reach_ / 4;
  });
  Eigen::AlignedBox3d box;
  for (size_t k = 0; k < moves.size(); ++k)
    if (moves[k]) box.extend(posed.row(chosen_[k]).transpose());
  std::vector<int> near;
  if (box.isEmpty()) return near;
  const Eigen::RowVector3d low = box.min().transpose().array() - reach_,
                           high = box.max().transpose().array() + reach_;
  for (int i : chosen_)
    if ((posed.row(i).array() >= low.array()).all() && (posed.row(i).array() <= high.array()).all())
      near.push_back(i);
  return near;
}

std::vector<std::vector<Contacts::Pair>> Contacts::closing_pairs(const PointGrid& grid,
                                                                 ThreadPool& pool) const {
  struct Seen {
    Eigen::RowVector3d rest;
    int part;
  };
  std::vector<Seen> seen(static_cast<size_t>(grid.count()));  // in the grid's order
  pool.parallel_for(grid.count(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (int k = static_cast<int>(begin); k < static_cast<int>(end); ++k)
      seen[size_t(k)] = {rest_.row(grid.point(k)), parts_[size_t(grid.point(k))]};
  });
  std::vector<std::vector<Pair>> found(kRanges);
  pool.run(kRanges, [&](int range) {
    const auto bound = [&](int of) {
      return static_cast<int>(int64_t{grid.count()} * of / kRanges);
    };
    for (int k = bound(range); k < bound(range + 1); ++k)
      grid.near_after(k, kCrowd, [&](int l, double squared) {
        const double rest = (seen[size_t(k)].rest - seen[size_t(l)].rest).squaredNorm();
        if (!(4 * squared < rest) || seen[size_t(k)].part != seen[size_t(l)].part) return;
        const double a = std::sqrt(rest), b = std::sqrt(squared);
        const double share =
            risen(1 - b / reach_) * risen(1 - 2 * b / a) * risen(2 * (a - b) / reach_ - 1);
        if (share > 0)
          found[size_t(range)].push_back(
              {{grid.point(k), grid.point(l)}, static_cast<float>(share)});
      });
  });
  return found;
}

bool Contacts::take(const Positions& posed, ThreadPool& pool) {
  const std::vector<int> near = near_what_moves(posed, pool);
  if (near.empty()) return false;
  const std::vector<std::vector<Pair>> found =
      closing_pairs(PointGrid(posed, near, reach_, pool), pool);
  begin_.assign(static_cast<size_t>(posed.rows()) + 1, 0);
  for (const std::vector<Pair>& of_range : found)
    for (const Pair& pair : of_range)
      for (int i : pair.points) ++begin_[size_t(i) + 1];
  std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
  partners_.resize(begin_.back());
  std::vector<size_t> next(begin_.begin(), begin_.end() - 1);
  for (const std::vector<Pair>& of_range : found)
    for (const Pair& pair : of_range)
      for (int side = 0; side < 2; ++side)
        partners_[next[size_t(pair.points[side])]++] = {pair.points[1 - side], pair.share};
  return !partners_.empty();
}

Rows Contacts::missing(const Positions& posed, const Positions& placed, ThreadPool& pool) const {
  Rows result = Rows::Zero(posed.rows(), 4);
  const auto find = [&](Index i) {
    Eigen::RowVector3d sum = Eigen::RowVector3d::Zero();
    double shares = 0, most = 0;
    for (size_t k = begin_[size_t(i)]; k < begin_[size_t(i) + 1]; ++k) {
      const Partner& partner = partners_[k];
      sum += partner.share * (posed.row(partner.point) - placed.row(partner.point));
      shares += partner.share;
      most = std::max<double>(most, partner.share);
    }
    if (!(shares > 0)) return;
    const Eigen::RowVector3d e = (posed.row(i) - placed.row(i) - sum / shares) / 2;
    const double doubt = e.squaredNorm() / (kFarReaches * kFarReaches * reach_ * reach_);
    const double share = stands_for_[size_t(i)] * most / (1 + doubt * doubt);
    result.row(i) << share * e, share;
  };
  pool.parallel_for(result.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (Index i = begin; i < end; ++i) find(i);
  });
  return result;
}

}  // namespace dd
