// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <functional>

#include "reconstruction/factored_surface.h"

namespace dd {

/// Replaces the first three columns of the free rows by the harmonic values that the other rows
/// determine. Rows in FactoredSurface::order().
using HarmonicExtension = std::function<void(Rows&)>;

/// By a surface's L.
inline HarmonicExtension extension_over(const FactoredSurface& surface) {
  return [&surface](Rows& values) { surface.poisson->extend(values); };
}

/// Calls use(first, count, values) for successive groups of up to three handles: column k < count
/// of values holds the harmonic weights of handle first + k, rows in FactoredSurface::order().
template <class Use>
void for_each_harmonic_weights(const FactoredSurface& surface, const HarmonicExtension& extend,
                               const Use& use) {
  const RowOrder& order = surface.order();
  // A solve has three columns, one for each handle of the group.
  for (int first = 0; first < surface.region.handle_count; first += 3) {
    Rows values = Rows::Zero(order.count(), 4);
    for (int r = order.free_count; r < order.fixed_begin; ++r) {
      const int column = surface.region.role[order.vertex_of_row[r]] - first;
      if (column >= 0 && column < 3) values(r, column) = 1;
    }
    extend(values);
    use(first, std::min(3, surface.region.handle_count - first), values);
  }
}

/// The harmonic weights of all handles, F×h: L w_h = 0 at free vertices, w_h = 1 at the vertices of
/// handle h and 0 at all other constrained vertices.
RowMatrix harmonic_weights(const FactoredSurface& surface, const HarmonicExtension& extend);

/// Interpolates values x_h of the handles over the surface by harmonic weights, Σ_h a_h x_h. If the
/// weights have no more entries than the Poisson factor, they are computed once and kept; else each
/// set_values() solves for the interpolated values, three columns at a time.
class HarmonicBlend {
 public:
  explicit HarmonicBlend(const FactoredSurface& surface)
      : HarmonicBlend(surface, extension_over(surface)) {}
  HarmonicBlend(const FactoredSurface& surface, HarmonicExtension extend);

  /// Sets the values, h×k, a row for each handle.
  void set_values(RowMatrix values);
  /// The interpolated values of the free rows begin to end, (end − begin)×k. Thread-safe.
  RowMatrix rows(Index begin, Index end) const;

  double bytes() const;

 private:
  const FactoredSurface& surface_;
  HarmonicExtension extend_;
  bool keeps_weights_;
  RowMatrix weights_;  // F×h if keeps_weights_, else empty
  RowMatrix values_;   // h×k if keeps_weights_, else F×k
};

}  // namespace dd
