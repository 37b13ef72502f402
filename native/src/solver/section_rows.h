// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "solver/symbolic_cholesky.h"

namespace dd {

/// How the sections of a factor, its domains and the top, address the rows of a right-hand side, so
/// that all of them can add to it at the same time: its places, behind them slots for what a domain
/// gives to the top, and behind these a row for each section that nobody reads.
class SectionRows {
 public:
  SectionRows() = default;
  explicit SectionRows(const SymbolicCholesky& plan);

  int sections() const { return static_cast<int>(begin_.size()) - 1; }
  /// The first place of a section; of sections(): the end.
  int begin(int section) const { return begin_[section]; }
  /// Rows in all.
  int count() const { return places() + static_cast<int>(slot_target_.size()) + sections(); }

  /// Where a section adds what belongs to a place of its own or of the top.
  int target(int section, int place) const {
    const int top = begin_[sections() - 1];
    return section + 1 == sections() || place < top ? place : slot_of_top_[section][place - top];
  }
  /// Where it adds what belongs nowhere.
  int spare(int section) const { return count() - sections() + section; }

  /// Calls body(first row, number of rows) for the rows that a section fills, but the spare one.
  template <class Body>
  void each_range(int section, const Body& body) const {
    body(begin_[section], begin_[section + 1] - begin_[section]);
    if (section + 1 < sections())
      body(places() + slot_begin_[section], slot_begin_[section + 1] - slot_begin_[section]);
  }
  /// Adds what the slots hold to their places and leaves them zero.
  void fold(Rows& right) const;

  double bytes() const;

 private:
  int places() const { return begin_.back(); }

  std::vector<int> begin_;
  std::vector<int> slot_begin_, slot_target_;  // by domain; place of each
  std::vector<std::vector<int>> slot_of_top_;  // of each domain, by place in the top; -1: none
};

}  // namespace dd
