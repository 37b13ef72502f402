// SPDX-License-Identifier: GPL-3.0-or-later
#include "reconstruction/harmonic_blend.h"

#include <algorithm>
#include <utility>

namespace dd {

RowMatrix harmonic_weights(const FactoredSurface& surface, const HarmonicExtension& extend) {
  const int free_count = surface.order().free_count;
  RowMatrix weights(free_count, surface.region.handle_count);
  for_each_harmonic_weights(surface, extend, [&](int first, int count, const Rows& values) {
    weights.middleCols(first, count) = values.topLeftCorner(free_count, count);
  });
  return weights;
}

HarmonicBlend::HarmonicBlend(const FactoredSurface& surface, HarmonicExtension extend)
    : surface_(surface),
      extend_(std::move(extend)),
      keeps_weights_(int64_t{surface.region.handle_count} * surface.order().free_count <=
                     surface.poisson->entries()) {
  if (keeps_weights_) weights_ = harmonic_weights(surface_, extend_);
}

void HarmonicBlend::set_values(RowMatrix values) {
  if (keeps_weights_) {
    values_ = std::move(values);
    return;
  }
  const RowOrder& order = surface_.order();
  values_.resize(order.free_count, values.cols());
  Rows interpolated = Rows::Zero(order.count(), 4);
  for (Index first = 0; first < values.cols(); first += 3) {
    const Index count = std::min<Index>(3, values.cols() - first);
    for (int r = order.free_count; r < order.fixed_begin; ++r)
      interpolated.row(r).head(count) =
          values.row(surface_.region.role[order.vertex_of_row[r]]).segment(first, count);
    extend_(interpolated);
    values_.middleCols(first, count) = interpolated.topLeftCorner(order.free_count, count);
  }
}

RowMatrix HarmonicBlend::rows(Index begin, Index end) const {
  if (!keeps_weights_) return values_.middleRows(begin, end - begin);
  return weights_.middleRows(begin, end - begin) * values_;
}

double HarmonicBlend::bytes() const {
  return static_cast<double>(weights_.size() + values_.size()) * sizeof(double);
}

}  // namespace dd
