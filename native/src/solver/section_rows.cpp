// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/section_rows.h"

namespace dd {

SectionRows::SectionRows(const SymbolicCholesky& plan)
    : slot_begin_(plan.slot_begin), slot_target_(plan.slot_target) {
  const int domains = plan.domain_count();
  for (int section = 0; section <= domains + 1; ++section)
    begin_.push_back(plan.section_begin(section));
  const int top = begin_[domains];
  slot_of_top_.assign(static_cast<size_t>(domains),
                      std::vector<int>(static_cast<size_t>(plan.size() - top), -1));
  for (int d = 0; d < domains; ++d)
    for (int k = slot_begin_[d]; k < slot_begin_[d + 1]; ++k)
      slot_of_top_[d][slot_target_[k] - top] = plan.size() + k;
}

void SectionRows::fold(Rows& right) const {
  for (size_t k = 0; k < slot_target_.size(); ++k) {
    const Index slot = places() + Index(k);
    right.row(slot_target_[k]) += right.row(slot);
    right.row(slot).setZero();
  }
}

double SectionRows::bytes() const {
  size_t ints = slot_target_.size();
  for (const std::vector<int>& slots : slot_of_top_) ints += slots.size();
  return static_cast<double>(ints * sizeof(int));
}

}  // namespace dd
