// SPDX-License-Identifier: GPL-3.0-or-later
#include "transfer/contacts.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace dd {

namespace {

constexpr double kFarReaches = 4;
constexpr int kRanges = 64;  // that points are shared out in, whatever the threads
constexpr int kDense = 3;    // points in a reach
constexpr int kCrowd = 500;  // points about one: a few sheets of them are fewer

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
  std::vector<std::array<int64_t, 5>> by_place;  // cell, part and number
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

bool Contacts::take(const Positions& posed, ThreadPool& pool) {
  closing_.clear();
  if (chosen_.empty()) return false;
  const PointGrid grid(posed, chosen_, reach_);
  // Of two that come nearer by half of the reach one moves by half of that.
  std::vector<int> asked;
  std::vector<char> was_asked(static_cast<size_t>(posed.rows()));
  for (int k = 0; k < grid.count(); ++k) {
    const int i = grid.point(k);
    if (!((posed.row(i) - rest_.row(i)).norm() > reach_ / 4)) continue;
    was_asked[size_t(i)] = 1;
    asked.push_back(k);
  }
  closing_ = closing_of(grid, asked, pool);

  std::vector<char> is_partner(was_asked.size());
  for (const Closing& closing : closing_)
    for (const Partner& partner : closing.partners) is_partner[size_t(partner.point)] = 1;
  asked.clear();
  for (int k = 0; k < grid.count(); ++k)
    if (is_partner[size_t(grid.point(k))] && !was_asked[size_t(grid.point(k))]) asked.push_back(k);
  for (Closing& closing : closing_of(grid, asked, pool)) closing_.push_back(std::move(closing));
  return !closing_.empty();
}

std::vector<Contacts::Closing> Contacts::closing_of(const PointGrid& grid,
                                                    const std::vector<int>& asked,
                                                    ThreadPool& pool) const {
  std::vector<std::vector<Closing>> found(kRanges);
  pool.run(kRanges, [&](int range) {
    const size_t begin = asked.size() * range / kRanges, end = asked.size() * (range + 1) / kRanges;
    for (size_t number = begin; number < end; ++number) {
      Closing closing{grid.point(asked[number]), 0, {}};
      double sum = 0;
      grid.near(asked[number], kCrowd, [&](int l, double squared) {
        const int j = grid.point(l);
        if (parts_[size_t(j)] != parts_[size_t(closing.point)]) return;
        const double rest = (rest_.row(closing.point) - rest_.row(j)).squaredNorm();
        if (!(4 * squared < rest)) return;
        const double a = std::sqrt(rest), b = std::sqrt(squared);
        const double share =
            risen(1 - b / reach_) * risen(1 - 2 * b / a) * risen(2 * (a - b) / reach_ - 1);
        if (!(share > 0)) return;
        closing.partners.push_back({j, static_cast<float>(share)});
        closing.share = std::max(closing.share, share);
        sum += share;
      });
      if (closing.partners.empty()) continue;
      for (Partner& partner : closing.partners)
        partner.share = static_cast<float>(partner.share / sum);
      found[size_t(range)].push_back(std::move(closing));
    }
  });
  std::vector<Closing> result;
  for (std::vector<Closing>& of_range : found)
    for (Closing& closing : of_range) result.push_back(std::move(closing));
  return result;
}

Rows Contacts::missing(const Positions& posed, const Positions& placed) const {
  Rows result = Rows::Zero(posed.rows(), 4);
  for (const Closing& closing : closing_) {
    Eigen::RowVector3d e = posed.row(closing.point) - placed.row(closing.point);
    for (const Partner& partner : closing.partners)
      e -= partner.share * (posed.row(partner.point) - placed.row(partner.point));
    e /= 2;
    const double doubt = e.squaredNorm() / (kFarReaches * kFarReaches * reach_ * reach_);
    const double share = stands_for_[size_t(closing.point)] * closing.share / (1 + doubt * doubt);
    result.row(closing.point) << share * e, share;
  }
  return result;
}

}  // namespace dd
