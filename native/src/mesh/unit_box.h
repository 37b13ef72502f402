// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "support/types.h"

namespace dd {

/// Length of the bounding box's diagonal.
double bounding_box_diagonal(const Positions& positions);

/// What takes positions into a box of diagonal 1 about the origin, in which everything is solved:
/// so no tolerance depends on the user's unit, or on how far from the origin a mesh was modelled.
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

  double scale = 1;  ///< of the positions: the diagonal of their box
  Eigen::RowVector3d centre = Eigen::RowVector3d::Zero();
};

}  // namespace dd
