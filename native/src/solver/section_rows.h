// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "solver/symbolic_cholesky.h"

namespace dd {

/// Layout of the rows of a right-hand side to which all sections of a factor, its domains and the
/// top, can add concurrently. First come the factor's places, then slots, in which each domain
/// accumulates its contributions to the top, then a spare row for each section, never read.
class SectionRows {
 public:
  SectionRows() = default;
  explicit SectionRows(const SymbolicCholesky& plan);

  int sections() const { return static_cast<int>(begin_.size()) - 1; }
  /// The first place of a section; the end of all places for sections().
  int begin(int section) const { return begin_[section]; }
  /// Number of rows.
  int count() const { return places() + static_cast<int>(slot_target_.size()) + sections(); }

  /// The row to which a section adds values for a place of its own or of the top.
  int target(int section, int place) const {
    const int top = begin_[sections() - 1];
    return section + 1 == sections() || place < top ? place : slot_of_top_[section][place - top];
  }
  /// The row to which it adds values to be discarded.
  int spare(int section) const { return count() - sections() + section; }

  /// Calls body(first row, number of rows) for the ranges that a section fills, except its spare
  /// row.
  template <class Body>
  void each_range(int section, const Body& body) const {
    body(begin_[section], begin_[section + 1] - begin_[section]);
    if (section + 1 < sections())
      body(places() + slot_begin_[section], slot_begin_[section + 1] - slot_begin_[section]);
  }
  /// Adds the slots to their places in the top and clears them.
  void fold(Rows& right) const;

  double bytes() const;

 private:
  int places() const { return begin_.back(); }

  std::vector<int> begin_;
  std::vector<int> slot_begin_, slot_target_;  // first slot of each domain; place of each slot
  std::vector<std::vector<int>> slot_of_top_;  // by domain, then place in the top: row, or -1
};

}  // namespace dd
