// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "support/thread_pool.h"
#include "support/types.h"

namespace dd {

/// A cube of space, one of equal ones side by side.
struct Cell {
  int64_t x, y, z;
};
/// The cell of that width in which a place lies, as seen from the origin of the first one.
Cell cell_at(const Eigen::RowVector3d& from_origin, double width);

/// Points in cells as wide as a reach, to find those near one another.
class PointGrid {
 public:
  /// chosen: of the points, ascending; the others aren't there.
  PointGrid(const Positions& points, const std::vector<int>& chosen, double reach,
            ThreadPool& pool);

  /// The chosen points cell by cell: neighbours in space are neighbours in memory.
  int count() const { return static_cast<int>(entries_.size()); }
  int point(int k) const { return entries_[size_t(k)].point; }

  /// Calls found(l, squared distance) for the k-th point and each l-th one, l > k, that is nearer
  /// to it than the reach, in an order that depends on the points alone: from all k, each pair
  /// once. most: of a crowd only about so many are looked at, evenly.
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
        // Three cells along x are three slots on end, which may begin again at the first.
        const size_t slot = slot_of({own.cell.x - 1, y, z}), last = std::min(slot + 3, slots_);
        add(slot, last);
        if (slot + 3 > last) add(0, slot + 3 - last);
      }
    const int step = 1 + crowd / most;
    for (const Column* column = columns; column != columns + count; ++column)
      for (int l = column->begin + k % step; l < column->end; l += step) {
        const Entry& other = entries_[size_t(l)];
        const double squared = (other.place - own.place).squaredNorm();
        // Other cells share these slots.
        if (squared < reach_ * reach_ && other.cell.y == column->y && other.cell.z == column->z)
          found(l, squared);
      }
  }

 private:
  struct Entry {
    Cell cell;
    Eigen::RowVector3d place;
    int point;
  };
  /// Entries of three cells along x, and of others that share their slots.
  struct Column {
    int64_t y, z;
    int begin, end;
  };
  static constexpr int kColumns = 18;  // nine about a cell, each in up to two pieces
  size_t slot_of(const Cell& cell) const {
    // Cells side by side along x are side by side in memory.
    const uint64_t mixed =
        uint64_t(cell.y) * 0xC2B2AE3D27D4EB4Fu ^ uint64_t(cell.z) * 0x165667B19E3779F9u;
    return static_cast<size_t>(((mixed ^ mixed >> 29) + uint64_t(cell.x)) & (slots_ - 1));
  }

  double reach_;
  size_t slots_ = 4;  // a power of two
  std::vector<int> begin_;
  std::vector<Entry> entries_;  // by slot
};

}  // namespace dd
