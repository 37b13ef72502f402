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
  const HandleExtension& own = bound_.surface_extension;
  frame.offsets.topRows(free_count).setZero();
  (own.empty() ? bound_.extension : own).displace(frame.coefficients, frame.offsets, frame.offsets);
}

}  // namespace dd
