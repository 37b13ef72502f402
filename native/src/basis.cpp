// SPDX-License-Identifier: GPL-3.0-or-later
#include "basis.h"

namespace dd {

HandleBasis handle_basis(const BendingSystem& bending, const Region& region,
                         const Positions& positions) {
  HandleBasis basis;
  basis.centres = Positions::Zero(region.handle_count, 3);
  Eigen::VectorXd counts = Eigen::VectorXd::Zero(region.handle_count);
  for (int v : region.handle_vertices) {
    basis.centres.row(region.role[v]) += positions.row(v);
    counts[region.role[v]] += 1;
  }
  basis.centres.array().colwise() /= counts.array();

  // One handle at a time: the values of all handles at once would be n×4h.
  basis.weights.resize(region.free_count(), 4 * region.handle_count);
  for (int h = 0; h < region.handle_count; ++h) {
    RowMatrix values = RowMatrix::Zero(positions.rows(), 4);
    for (int v : region.handle_vertices)
      if (region.role[v] == h) values.row(v) = handle_coordinates(positions, v, basis.centres, h);
    basis.weights.middleCols(4 * h, 4) = bending.extend(values);
  }
  return basis;
}

}  // namespace dd
