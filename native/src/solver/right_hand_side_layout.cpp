// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/right_hand_side_layout.h"

namespace dd {

RightHandSideLayout::RightHandSideLayout(const SymbolicCholesky& plan)
    : slot_begin_(plan.slot_begin), top_index_of_slot_(plan.top_index_of_slot) {
  const int domains = plan.domain_count();
  for (int section = 0; section <= domains + 1; ++section)
    begin_.push_back(plan.section_begin(section));
  const int top = begin_[domains];
  slot_of_top_.assign(static_cast<size_t>(domains),
                      std::vector<int>(static_cast<size_t>(plan.size() - top), -1));
  for (int d = 0; d < domains; ++d)
    for (int k = slot_begin_[d]; k < slot_begin_[d + 1]; ++k)
      slot_of_top_[d][top_index_of_slot_[k] - top] = plan.size() + k;
}

void RightHandSideLayout::gather_slots(Rows& right) const {
  for (size_t k = 0; k < top_index_of_slot_.size(); ++k) {
    const Index slot = size() + Index(k);
    right.row(top_index_of_slot_[k]) += right.row(slot);
    right.row(slot).setZero();
  }
}

double RightHandSideLayout::bytes() const {
  size_t ints = top_index_of_slot_.size();
  for (const std::vector<int>& slots : slot_of_top_) ints += slots.size();
  return static_cast<double>(ints * sizeof(int));
}

}  // namespace dd
