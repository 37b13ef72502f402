// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "base/bound_surface.h"

namespace dd {

/// Calls use(first, count, values) for successive groups of up to three handles: column k < count
/// of values holds the harmonic weights of handle first + k, rows in BoundSurface::order().
template <class Use>
void for_each_harmonic_weights(const BoundSurface& bound, const Use& use) {
  const RowOrder& order = bound.order();
  // A solve of the Poisson system has three columns, one for each handle of the group.
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

/// The harmonic weights of all handles, F×h: L w_h = 0 at free vertices, w_h = 1 at the vertices of
/// handle h and 0 at all other constrained vertices.
RowMatrix harmonic_weights(const BoundSurface& bound);

/// Interpolates values x_h of the handles over the surface by harmonic weights, Σ_h a_h x_h. If the
/// weights have no more entries than the Poisson factor, they are computed once and kept; else each
/// set_values() solves for the interpolated values, three columns at a time.
class HarmonicBlend {
 public:
  explicit HarmonicBlend(const BoundSurface& bound);

  /// Sets the values, h×k, a row for each handle.
  void set_values(RowMatrix values);
  /// The interpolated values of the free rows begin to end, (end − begin)×k. Thread-safe.
  RowMatrix rows(Index begin, Index end) const;

  double bytes() const;

 private:
  const BoundSurface& bound_;
  bool keeps_weights_;
  RowMatrix weights_;  // F×h if keeps_weights_, else empty
  RowMatrix values_;   // h×k if keeps_weights_, else F×k
};

}  // namespace dd
