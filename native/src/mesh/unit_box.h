// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "support/types.h"

namespace dd {

/// Length of the bounding box's diagonal.
double bounding_box_diagonal(const Positions& positions);

/// Maps positions into a bounding box of diagonal 1 centred at the origin, in which everything is
/// solved: no tolerance then depends on the user's unit or on the mesh's distance from the origin.
struct UnitBox {
  UnitBox() = default;
  explicit UnitBox(const Positions& positions)
      : scale(bounding_box_diagonal(positions)),
        centre(0.5 * (positions.colwise().maxCoeff() + positions.colwise().minCoeff())) {}

  Positions into(const Positions& positions) const {
    return (positions.rowwise() - centre) / scale;
  }
  Positions out_of(const Positions& positions) const {
    return (scale * positions).rowwise() + centre;
  }

  double scale = 1;  ///< diagonal of the positions' bounding box
  Eigen::RowVector3d centre = Eigen::RowVector3d::Zero();
};

}  // namespace dd
