// SPDX-License-Identifier: GPL-3.0-or-later
#include "methods/gradient_editing.h"

#include "surface/handle_blend.h"

namespace dd {

GradientEditing::GradientEditing(BoundSurface& bound) : bound_(bound) {
  const Triangles& t = bound.mesh.triangles;
  const RowOrder& order = bound.order();
  const std::vector<int>& active = bound.poisson->active().triangles;
  const int handle_count = bound.region.handle_count;

  const Positions flux = corner_divergence(bound.operators.metric, bound.mesh.positions, t);
  flux_.resize(3 * static_cast<Index>(active.size()), 3);
  weights_ = RowMatrix::Zero(static_cast<Index>(active.size()), handle_count);
  for (size_t i = 0; i < active.size(); ++i)
    flux_.middleRows<3>(3 * Index(i)) = flux.middleRows<3>(3 * Index(active[i]));

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
  const Triangles& t = bound_.mesh.triangles;
  const ActiveTriangles& active = bound_.poisson->active();
  const HandleBlend blend(frame.linear, weights_, options.rotation_only);
  const auto add = [&](int part, double* rows) {
    for (int i = active.begin[part]; i < active.begin[part + 1]; ++i) {
      const Eigen::Matrix3d turned = blend.at(i) * flux_.middleRows<3>(3 * Index(i)).transpose();
      for (int k = 0; k < 3; ++k)
        Eigen::Map<Eigen::Vector3d>(
            rows + 4 * Index(bound_.poisson->target(part, t(active.triangles[i], k)))) +=
            turned.col(k);
    }
  };
  bound_.poisson->solve(bound_.poisson->rest_divergence(), add, frame.offsets);
}

double GradientEditing::bytes() const {
  return static_cast<double>((flux_.size() + weights_.size()) * Index(sizeof(double)));
}

}  // namespace dd
