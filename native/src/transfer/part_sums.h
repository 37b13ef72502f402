// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <vector>

#include "support/thread_pool.h"

namespace dd {

/// Parallel sums over the items of each loose part of a mesh, balanced for a single part as for
/// thousands of two triangles each. Results don't depend on the number of threads.
class PartSums {
 public:
  PartSums() = default;
  /// sizes: the number of items of each part.
  explicit PartSums(const std::vector<size_t>& sizes) : part_count_(sizes.size()) {
    size_t of_task = kLeastRange;  // items of the last task
    for (size_t part = 0; part < sizes.size(); ++part)
      for (size_t begin = 0; begin < sizes[part]; begin += kLeastRange) {
        if (of_task >= kLeastRange) {
          tasks_.push_back(ranges_.size());
          of_task = 0;
        }
        ranges_.push_back({part, begin, std::min(sizes[part], begin + kLeastRange)});
        of_task += ranges_.back().end - begin;
      }
    tasks_.push_back(ranges_.size());
  }

  /// The Sum of each part: add(sum, part, i) adds its item i, from 0 on, and += joins partial Sums.
  template <class Sum, class Add>
  std::vector<Sum> of(ThreadPool& pool, const Add& add) const {
    std::vector<Sum> of_ranges(ranges_.size()), sums(part_count_);
    pool.run(static_cast<int>(tasks_.size()) - 1, [&](int task) {
      for (size_t k = tasks_[size_t(task)]; k < tasks_[size_t(task) + 1]; ++k) {
        Sum sum;
        for (size_t i = ranges_[k].begin; i < ranges_[k].end; ++i) add(sum, ranges_[k].part, i);
        of_ranges[k] = sum;
      }
    });
    for (size_t k = 0; k < ranges_.size(); ++k) sums[ranges_[k].part] += of_ranges[k];
    return sums;
  }

 private:
  struct Range {
    size_t part, begin, end;
  };
  size_t part_count_ = 0;
  std::vector<Range> ranges_;
  std::vector<size_t> tasks_;  // first range of each task, and the end
};

}  // namespace dd
