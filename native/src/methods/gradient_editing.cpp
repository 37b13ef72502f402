// SPDX-License-Identifier: GPL-3.0-or-later
#include "methods/gradient_editing.h"

#include "support/handle_blend.h"

namespace dd {

GradientEditing::GradientEditing(BoundSurface& bound) : bound_(bound), flux_(bound) {
  const Triangles& t = bound.mesh.triangles;
  const RowOrder& order = bound.order();
  const std::vector<int>& active = bound.poisson->active().triangles;
  const int handle_count = bound.region.handle_count;

  weights_ = RowMatrix::Zero(static_cast<Index>(active.size()), handle_count);
  // Three handles a solve: a right-hand side of the Poisson system has three columns.
  for (int first = 0; first < handle_count; first += 3) {
    Rows values = Rows::Zero(order.count(), 4);
    for (int r = order.free_count; r < order.fixed_begin; ++r) {
      const int column = bound.region.role[order.vertex_of_row[r]] - first;
      if (column >= 0 && column < 3) values(r, column) = 1;
    }
    bound.poisson->extend(values);
    for (size_t i = 0; i < active.size(); ++i)
      for (int column = 0; column < std::min(3, handle_count - first); ++column)
        for (int k = 0; k < 3; ++k)
          weights_(Index(i), first + column) +=
              values(order.row_of_vertex[t(active[i], k)], column) / 3;
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
