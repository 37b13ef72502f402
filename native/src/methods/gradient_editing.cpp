// SPDX-License-Identifier: GPL-3.0-or-later
#include "methods/gradient_editing.h"

#include "support/handle_blend.h"
#include "surface/harmonic_blend.h"

namespace dd {

GradientEditing::GradientEditing(BoundSurface& bound) : bound_(bound), flux_(bound) {
  const Triangles& t = bound.operators.triangles;
  const RowOrder& order = bound.order();
  const std::vector<int>& active = bound.poisson->active().triangles;

  // A triangle's weight is the mean of its corners'; those of a handle have 1 of their own.
  const RowMatrix of_vertices = harmonic_weights(bound);
  weights_ = RowMatrix::Zero(static_cast<Index>(active.size()), bound.region.handle_count);
  for (size_t i = 0; i < active.size(); ++i)
    for (int k = 0; k < 3; ++k) {
      const int v = t(active[i], k), row = order.row_of_vertex[v];
      if (row < order.free_count)
        weights_.row(Index(i)) += of_vertices.row(row) / 3;
      else if (bound.region.role[v] >= 0)
        weights_(Index(i), bound.region.role[v]) += 1.0 / 3;
    }
}

void GradientEditing::update(const Frame& frame, const MethodOptions& options) {
  const HandleBlend blend(frame.linear, weights_, options.rotation_only);
  bound_.poisson->solve(
      bound_.poisson->rest_divergence(),
      [&](int section, double* rows) {
        flux_.add(
            section, [&](int i, int) { return blend.at(i); }, rows);
      },
      frame.offsets);
}

double GradientEditing::bytes() const {
  return flux_.bytes() + static_cast<double>(weights_.size() * Index(sizeof(double)));
}

}  // namespace dd
