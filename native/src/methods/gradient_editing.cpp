// SPDX-License-Identifier: GPL-3.0-or-later
#include "methods/gradient_editing.h"

#include <utility>

#include "support/handle_blend.h"

namespace dd {

GradientEditing::GradientEditing(BoundSurface& bound)
    : bound_(bound), flux_(bound), harmonic_(bound) {}

void GradientEditing::update(const Frame& frame, const MethodOptions& options) {
  const RowOrder& order = bound_.order();
  RowMatrix terms = blend_terms(frame.linear, options.rotation_only);
  sums_.setZero(order.count(), terms.cols());
  for (int r = order.free_count; r < order.fixed_begin; ++r)
    sums_.row(r) = terms.row(bound_.region.role[order.vertex_of_row[r]]);
  harmonic_.set_values(std::move(terms));
  bound_.poisson->pool().parallel_for(
      order.free_count, kLeastRange, [&](int64_t begin, int64_t end) {
        sums_.middleRows(begin, end - begin) = harmonic_.rows(begin, end);
      });
  const Triangles& t = bound_.operators.triangles;
  bound_.poisson->solve(
      bound_.poisson->rest_divergence(),
      [&](int section, double* rows) {
        flux_.add(
            section,
            [&](int, int triangle) {
              Eigen::Matrix<double, 1, Eigen::Dynamic, Eigen::RowMajor, 1, 12> mean =
                  sums_.row(order.row_of_vertex[t(triangle, 0)]) / 3;
              for (int k = 1; k < 3; ++k)
                mean += sums_.row(order.row_of_vertex[t(triangle, k)]) / 3;
              return blended(mean);
            },
            rows);
      },
      frame.offsets);
}

double GradientEditing::bytes() const {
  return flux_.bytes() + harmonic_.bytes() + static_cast<double>(sums_.size()) * sizeof(double);
}

}  // namespace dd
