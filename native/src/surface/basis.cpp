// SPDX-License-Identifier: GPL-3.0-or-later
#include "surface/basis.h"

namespace dd {

Positions handle_centres(const Region& region, const Positions& positions) {
  Positions centres = Positions::Zero(region.handle_count, 3);
  Eigen::VectorXd counts = Eigen::VectorXd::Zero(region.handle_count);
  for (int v : region.handle_vertices) {
    centres.row(region.role[v]) += positions.row(v);
    counts[region.role[v]] += 1;
  }
  centres.array().colwise() /= counts.array();
  return centres;
}

HandleBasis handle_basis(const PolyharmonicSystem& bending, const Region& region,
                         const Positions& positions, const RowOrder& order,
                         const std::function<void(double)>& progress) {
  HandleBasis basis;
  basis.centres = handle_centres(region, positions);

  // One handle at a time: the values of all handles at once would be n×4h.
  basis.weights.resize(region.free_count(), 4 * region.handle_count);
  for (int h = 0; h < region.handle_count; ++h) {
    RowMatrix values = RowMatrix::Zero(positions.rows(), 4);
    for (int v : region.handle_vertices)
      if (region.role[v] == h) values.row(v) = handle_coordinates(positions, v, basis.centres, h);
    const RowMatrix extended = bending.extend(values);
    for (int r = 0; r < region.free_count(); ++r)
      basis.weights.row(order.row_of_vertex[region.free[r]]).segment<4>(4 * h) = extended.row(r);
    if (progress) progress((h + 1.0) / region.handle_count);
  }
  return basis;
}

}  // namespace dd
