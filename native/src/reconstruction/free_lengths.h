// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "reconstruction/factored_surface.h"

namespace dd {

/// Distances along edges from each active vertex, by active index.
struct FreeLengths {
  Eigen::VectorXd depths;  ///< to the nearest rim
  /// The free length: that, and to the nearest rim that moves in another way; 0 where there is
  /// none.
  Eigen::VectorXd lengths;
};
FreeLengths free_lengths(const FactoredSurface& surface);

}  // namespace dd
