// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "solver/symbolic_cholesky.h"

namespace dd {

/// Layout of the rows of a right-hand side to which all sections of a factor, its domains and the
/// top, can add concurrently. First come the rows of the factor, then slots, in which each domain
/// accumulates its contributions to the top, then for each section a row to discard values in.
class RightHandSideLayout {
 public:
  RightHandSideLayout() = default;
  explicit RightHandSideLayout(const SymbolicCholesky& plan);

  int sections() const { return static_cast<int>(begin_.size()) - 1; }
  /// The first row of a section; the number of the factor's rows for sections().
  int begin(int section) const { return begin_[section]; }
  /// Number of rows.
  int count() const { return size() + static_cast<int>(top_index_of_slot_.size()) + sections(); }

  /// The row to which a section adds values for a factor's row, its own or one of the top.
  int row_for(int section, int index) const {
    const int top = begin_[sections() - 1];
    return section + 1 == sections() || index < top ? index : slot_of_top_[section][index - top];
  }
  /// The row to which it adds values that are never read.
  int discard_row(int section) const { return count() - sections() + section; }

  /// Calls body(first row, number of rows) for the ranges that a section fills, except its
  /// discard_row().
  template <class Body>
  void each_range(int section, const Body& body) const {
    body(begin_[section], begin_[section + 1] - begin_[section]);
    if (section + 1 < sections())
      body(size() + slot_begin_[section], slot_begin_[section + 1] - slot_begin_[section]);
  }
  /// Adds the slots to their rows of the top and clears them.
  void gather_slots(Rows& right) const;

  double bytes() const;

 private:
  int size() const { return begin_.back(); }

  std::vector<int> begin_;
  std::vector<int> slot_begin_, top_index_of_slot_;  // by domain, less size(); row, by slot
  std::vector<std::vector<int>> slot_of_top_;  // by domain, then row of the top: row here, or -1
};

}  // namespace dd
