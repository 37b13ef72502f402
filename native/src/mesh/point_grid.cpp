// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/point_grid.h"

#include <algorithm>
#include <cmath>

namespace dd {

namespace {

// Largest cell index. Safety: the conversion to int64_t must not overflow.
constexpr double kMaxCellIndex = 1e15;

int64_t cell_along(double distance, double width) {
  return static_cast<int64_t>(
      std::clamp(std::floor(distance / width), -kMaxCellIndex, kMaxCellIndex));
}

}  // namespace

Cell cell_at(const Eigen::RowVector3d& from_origin, double width) {
  return {cell_along(from_origin.x(), width), cell_along(from_origin.y(), width),
          cell_along(from_origin.z(), width)};
}

PointGrid::PointGrid(const Positions& points, const std::vector<int>& chosen, double radius,
                     ThreadPool& pool)
    : radius_(radius) {
  while (slots_ < chosen.size()) slots_ *= 2;
  begin_.assign(slots_ + 1, 0);
  std::vector<Cell> cells(chosen.size());
  std::vector<size_t> slots(chosen.size());
  pool.parallel_for(
      static_cast<int64_t>(chosen.size()), kLeastRange, [&](int64_t begin, int64_t end) {
        for (auto k = static_cast<size_t>(begin); k < static_cast<size_t>(end); ++k) {
          cells[k] = cell_at(points.row(chosen[k]) - points.row(chosen.front()), radius);
          slots[k] = slot_of(cells[k]);
        }
      });
  for (size_t slot : slots) ++begin_[slot + 1];
  for (size_t slot = 0; slot < slots_; ++slot) begin_[slot + 1] += begin_[slot];
  entries_.resize(chosen.size());
  std::vector<int> next(begin_.begin(), begin_.end() - 1);
  for (size_t k = 0; k < chosen.size(); ++k)
    entries_[size_t(next[slots[k]]++)] = {cells[k], points.row(chosen[k]), chosen[k]};
}

}  // namespace dd
