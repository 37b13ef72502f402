// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

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
  PointGrid(const Positions& points, const std::vector<int>& chosen, double reach);

  /// The chosen points cell by cell: neighbours in space are neighbours in memory.
  int count() const { return static_cast<int>(entries_.size()); }
  int point(int k) const { return entries_[size_t(k)].point; }

  /// Calls found(l, squared distance) for the k-th point and each l-th one, l ≠ k, that is nearer
  /// to it than the reach, in an order that depends on the points alone. most: of a crowd only so
  /// many are looked at, evenly.
  template <class Found>
  void near(int k, int most, const Found& found) const {
    const Entry& own = entries_[size_t(k)];
    int crowd = 0;
    in_columns(own.cell, [&](int64_t, int64_t, int begin, int end) { crowd += end - begin; });
    const int step = 1 + crowd / most;
    in_columns(own.cell, [&](int64_t y, int64_t z, int begin, int end) {
      for (int l = begin; l < end; l += step) {
        const Entry& other = entries_[size_t(l)];
        const double squared = (other.place - own.place).squaredNorm();
        // Other cells share these slots.
        if (squared < reach_ * reach_ && l != k && other.cell.y == y && other.cell.z == z)
          found(l, squared);
      }
    });
  }

 private:
  struct Entry {
    Cell cell;
    Eigen::RowVector3d place;
    int point;
  };
  size_t slot_of(const Cell& cell) const;

  /// Calls range(y, z, begin, end) for the entries of three cells along x and of others, in each of
  /// the nine columns about a cell.
  template <class Range>
  void in_columns(const Cell& cell, const Range& range) const {
    for (int64_t y = cell.y - 1; y <= cell.y + 1; ++y)
      for (int64_t z = cell.z - 1; z <= cell.z + 1; ++z) {
        // Three cells along x are three slots on end, which may begin again at the first.
        const size_t slot = slot_of({cell.x - 1, y, z}), last = std::min(slot + 3, slots_);
        range(y, z, begin_[slot], begin_[last]);
        if (slot + 3 > last) range(y, z, begin_[0], begin_[slot + 3 - last]);
      }
  }

  double reach_;
  size_t slots_ = 4;  // a power of two
  std::vector<int> begin_;
  std::vector<Entry> entries_;  // by slot
};

}  // namespace dd
