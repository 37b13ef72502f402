// SPDX-License-Identifier: GPL-3.0-or-later
#include "variational.h"

namespace dd {

void Variational::update(const Frame& frame, const MethodOptions&) {
  const RowMatrix& weights =
      bound_.surface_basis.weights.size() ? bound_.surface_basis.weights : bound_.basis.weights;
  frame.offsets.topRows(bound_.order().free_count).noalias() = weights * frame.coefficients;
}

}  // namespace dd
