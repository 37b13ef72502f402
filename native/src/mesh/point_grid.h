// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "support/thread_pool.h"
#include "support/types.h"

namespace dd {

/// Indices of a cubic cell of a uniform grid.
struct Cell {
  int64_t x, y, z;
};
/// The cell, of this width, that contains a point given relative to the grid's origin, a corner of
/// cell (0, 0, 0).
Cell cell_at(const Eigen::RowVector3d& from_origin, double width);

/// A hashed uniform grid for fixed-radius neighbour queries; its cells are as wide as the radius.
class PointGrid {
 public:
  /// chosen: indices of the points to insert, ascending; the first is the grid's origin. radius:
  /// of the queries.
  PointGrid(const Positions& points, const std::vector<int>& chosen, double radius,
            ThreadPool& pool);

  /// The chosen points, grouped by cell: neighbours in space are close in memory. point(k): the
  /// index of the k-th among all points.
  int count() const { return static_cast<int>(entries_.size()); }
  int point(int k) const { return entries_[size_t(k)].point; }

  /// Calls found(l, squared distance) for each l-th point, l > k, nearer to the k-th than the
  /// radius, so that a loop over all k visits each pair once. The order depends on the points
  /// alone. most: of more candidates than this only an evenly spaced sample of about so many is
  /// tested.
  template <class Found>
  void near_after(int k, int most, const Found& found) const {
    const Entry& own = entries_[size_t(k)];
    Column columns[kColumns];
    int count = 0, crowd = 0;
    for (int64_t y = own.cell.y - 1; y <= own.cell.y + 1; ++y)
      for (int64_t z = own.cell.z - 1; z <= own.cell.z + 1; ++z) {
        const auto add = [&](size_t slot, size_t end) {
          const Column column = {y, z, std::max(begin_[slot], k + 1), begin_[end]};
          if (column.begin >= column.end) return;
          columns[count++] = column;
          crowd += column.end - column.begin;
        };
        // Three cells along x are three consecutive slots, which may wrap around to the first.
        const size_t slot = slot_of({own.cell.x - 1, y, z}), last = std::min(slot + 3, slots_);
        add(slot, last);
        if (slot + 3 > last) add(0, slot + 3 - last);
      }
    const int step = 1 + crowd / most;
    for (const Column* column = columns; column != columns + count; ++column)
      for (int l = column->begin + k % step; l < column->end; l += step) {
        const Entry& other = entries_[size_t(l)];
        const double squared = (other.position - own.position).squaredNorm();
        // Skips points of other columns that hash to these slots.
        if (squared < radius_ * radius_ && other.cell.y == column->y && other.cell.z == column->z)
          found(l, squared);
      }
  }

 private:
  struct Entry {
    Cell cell;
    Eigen::RowVector3d position;
    int point;
  };
  /// Entries of three consecutive cells along x, and of others that hash to the same slots.
  struct Column {
    int64_t y, z;
    int begin, end;
  };
  static constexpr int kColumns = 18;  // derived: 3 × 3 around a cell, two pieces if they wrap
  size_t slot_of(const Cell& cell) const {
    // x is added to the hash of y and z, so cells adjacent along x have adjacent slots.
    const uint64_t mixed =
        uint64_t(cell.y) * 0xC2B2AE3D27D4EB4Fu ^ uint64_t(cell.z) * 0x165667B19E3779F9u;
    return static_cast<size_t>(((mixed ^ mixed >> 29) + uint64_t(cell.x)) & (slots_ - 1));
  }

  double radius_;
  size_t slots_ = 4;  // a power of two
  std::vector<int> begin_;
  std::vector<Entry> entries_;  // sorted by slot
};

}  // namespace dd
