// SPDX-License-Identifier: GPL-3.0-or-later
#include "methods/variational.h"

namespace dd {

void Variational::update(const Frame& frame, const MethodOptions&) {
  const int free_count = bound_.order().free_count;
  if (bound_.outside_base()) {
    frame.offsets.topRows(free_count) =
        frame.base.topRows(free_count) - bound_.rest_base.topRows(free_count);
    return;
  }
  const RowMatrix& weights =
      bound_.surface_basis.weights.size() ? bound_.surface_basis.weights : bound_.basis.weights;
  frame.offsets.topRows(free_count).noalias() = weights * frame.coefficients;
}

}  // namespace dd
