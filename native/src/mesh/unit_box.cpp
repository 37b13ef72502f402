// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/unit_box.h"

namespace dd {

double bounding_box_diagonal(const Positions& positions) {
  return (positions.colwise().maxCoeff() - positions.colwise().minCoeff()).norm();
}

}  // namespace dd
