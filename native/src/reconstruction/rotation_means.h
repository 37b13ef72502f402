// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "kernels/kernels.h"
#include "support/thread_pool.h"

namespace dd {

/// Weighted means of rotations, in blocks of kLanes. Means with fewer terms than the longest of
/// their block are padded with terms of weight zero.
template <class Real>
class RotationMeans {
 public:
  /// The terms of one mean: row of the rotations, weight. Weights sum to 1.
  using Terms = std::vector<std::pair<int, double>>;

  /// Appends a mean; close() after the last.
  void append(const Terms& terms) {
    waiting_[lane_++] = terms;
    if (lane_ == kLanes) close();
  }

  void close() {
    if (lane_ == 0) return;
    size_t longest = 1;
    for (int lane = 0; lane < kLanes; ++lane) {
      if (lane >= lane_) waiting_[lane].clear();
      if (waiting_[lane].empty()) waiting_[lane].emplace_back(0, 1.0);  // unused lane
      longest = std::max(longest, waiting_[lane].size());
    }
    for (size_t k = 0; k < longest; ++k) {
      index_.emplace_back();
      weights_.emplace_back();
      for (size_t lane = 0; lane < kLanes; ++lane) {
        const Terms& terms = waiting_[lane];
        index_.back()[lane] = terms[std::min(k, terms.size() - 1)].first;
        weights_.back()[lane] = k < terms.size() ? static_cast<Real>(terms[k].second) : Real(0);
      }
    }
    starts_.push_back(static_cast<int>(index_.size()));
    lane_ = 0;
  }

  /// The number of means, padded to whole blocks.
  size_t size() const { return kLanes * (starts_.size() - 1); }

  /// in, out: rows of 4, unit quaternions; out as many as size().
  void run(const std::vector<Real>& in, std::vector<Real>& out, ThreadPool& pool) const {
    // Least number of blocks worth a task: 512 means, as kLeastRange.
    constexpr int kLeastBlocks = 64;
    pool.parallel_for(
        static_cast<int64_t>(starts_.size()) - 1, kLeastBlocks, [&](int64_t begin, int64_t end) {
          kernels().of<Real>().mean_rotations(static_cast<int>(begin), static_cast<int>(end),
                                              starts_.data(), rows_of(index_), rows_of(weights_),
                                              in.data(), out.data());
        });
  }

  double bytes() const {
    return static_cast<double>(starts_.size() * sizeof(int) +
                               index_.size() * kLanes * (sizeof(int32_t) + sizeof(Real)));
  }

 private:
  /// The blocks as the arrays that kernels take.
  template <class Value>
  static const Value (*rows_of(const std::vector<std::array<Value, kLanes>>& blocks))
      [kLanes] { return reinterpret_cast<const Value(*)[kLanes]>(blocks.data()); }

  std::array<Terms, kLanes> waiting_;
  int lane_ = 0;
  std::vector<int> starts_{0};
  std::vector<std::array<int32_t, kLanes>> index_;
  std::vector<std::array<Real, kLanes>> weights_;
};

}  // namespace dd
