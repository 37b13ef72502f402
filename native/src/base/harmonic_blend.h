// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "base/bound_surface.h"

namespace dd {

/// Calls use(first, count, values) for a few handles after the other: the harmonic weights of
/// handles first to first + count are the free rows of the first columns of values.
template <class Use>
void each_harmonic_weights(const BoundSurface& bound, const Use& use) {
  const RowOrder& order = bound.order();
  // Three handles a solve: a right-hand side of the Poisson system has three columns.
  for (int first = 0; first < bound.region.handle_count; first += 3) {
    Rows values = Rows::Zero(order.count(), 4);
    for (int r = order.free_count; r < order.fixed_begin; ++r) {
      const int column = bound.region.role[order.vertex_of_row[r]] - first;
      if (column >= 0 && column < 3) values(r, column) = 1;
    }
    bound.poisson->extend(values);
    use(first, std::min(3, bound.region.handle_count - first), values);
  }
}

/// Of each handle the harmonic function that is 1 at its vertices and 0 at all others that are
/// held: free rows × handles.
RowMatrix harmonic_weights(const BoundSurface& bound);

/// Values of the handles, spread harmonically over the surface: Σ_h a_h x_h with the harmonic
/// weights a_h. With few handles the weights are made once and kept; with more of them than the
/// Poisson factor has entries a row, the values themselves are solved for, three columns at a time.
class HarmonicBlend {
 public:
  explicit HarmonicBlend(const BoundSurface& bound);

  /// values: h×k, a row for each handle.
  void take(RowMatrix values);
  /// What they come to in the free rows begin to end, (end − begin)×k. From any thread.
  RowMatrix rows(Index begin, Index end) const;

  double bytes() const;

 private:
  const BoundSurface& bound_;
  bool weighted_;
  RowMatrix weights_;  // F×h, or none
  RowMatrix values_;   // h×k, or F×k
};

}  // namespace dd
