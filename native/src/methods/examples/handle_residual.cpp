// SPDX-License-Identifier: GPL-3.0-or-later
#include "methods/examples/handle_residual.h"

#include <Eigen/QR>

namespace dd {

HandleResidual::HandleResidual(const BoundSurface& bound)
    : bound_(bound), handles_(static_cast<size_t>(bound.region.handle_count)) {
  const RowOrder& order = bound.order();
  for (int r = order.free_count; r < order.fixed_begin; ++r)
    handles_[bound.region.role[order.vertex_of_row[r]]].rows.push_back(r);
  for (size_t h = 0; h < handles_.size(); ++h) {
    Handle& handle = handles_[h];
    Eigen::MatrixXd arms(Index(handle.rows.size()), 4);
    for (size_t i = 0; i < handle.rows.size(); ++i)
      arms.row(Index(i)) << bound.rest.row(handle.rows[i]).head<3>() -
                                bound.coordinates.centres().row(Index(h)),
          1;
    handle.pseudo_inverse = arms.completeOrthogonalDecomposition().pseudoInverse();
  }
}

void HandleResidual::extend(const Rows& posed, Rows& offsets) const {
  RowMatrix coefficients = RowMatrix::Zero(4 * Index(handles_.size()), 4);
  for (size_t h = 0; h < handles_.size(); ++h)
    for (size_t i = 0; i < handles_[h].rows.size(); ++i) {
      const int r = handles_[h].rows[i];
      coefficients.middleRows<4>(4 * Index(h)) +=
          handles_[h].pseudo_inverse.col(Index(i)) * (offsets.row(r) - posed.row(r));
    }
  coefficients.col(3).setZero();
  const Rows handles = offsets.bottomRows(offsets.rows() - bound_.order().free_count);
  bound_.extension.displace(coefficients, posed, offsets);
  offsets.bottomRows(handles.rows()) = handles;
}

}  // namespace dd
