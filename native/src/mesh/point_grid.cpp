// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/point_grid.h"

#include <algorithm>
#include <cmath>

namespace dd {

namespace {

constexpr double kFarthest = 1e15;  // cells, which integers hold

int64_t cell_along(double distance, double width) {
  return static_cast<int64_t>(std::clamp(std::floor(distance / width), -kFarthest, kFarthest));
}

}  // namespace

Cell cell_at(const Eigen::RowVector3d& from_origin, double width) {
  return {cell_along(from_origin.x(), width), cell_along(from_origin.y(), width),
          cell_along(from_origin.z(), width)};
}

PointGrid::PointGrid(const Positions& points, const std::vector<int>& chosen, double reach)
    : reach_(reach) {
  while (slots_ < chosen.size()) slots_ *= 2;
  begin_.assign(slots_ + 1, 0);
  std::vector<Cell> cells;
  cells.reserve(chosen.size());
  for (int i : chosen) {
    cells.push_back(cell_at(points.row(i) - points.row(chosen.front()), reach));
    ++begin_[slot_of(cells.back()) + 1];
  }
  for (size_t slot = 0; slot < slots_; ++slot) begin_[slot + 1] += begin_[slot];
  entries_.resize(chosen.size());
  std::vector<int> next(begin_.begin(), begin_.end() - 1);
  for (size_t k = 0; k < chosen.size(); ++k)
    entries_[size_t(next[slot_of(cells[k])]++)] = {cells[k], points.row(chosen[k]), chosen[k]};
}

size_t PointGrid::slot_of(const Cell& cell) const {
  // Cells side by side along x are side by side in memory.
  const uint64_t mixed =
      uint64_t(cell.y) * 0xC2B2AE3D27D4EB4Fu ^ uint64_t(cell.z) * 0x165667B19E3779F9u;
  return static_cast<size_t>(((mixed ^ mixed >> 29) + uint64_t(cell.x)) & (slots_ - 1));
}

}  // namespace dd
