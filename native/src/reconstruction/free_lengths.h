// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <tuple>
#include <vector>

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
/// The same of a graph with free nodes, then rims with these roles. edges: two nodes and the length
/// between them, each edge any number of times.
FreeLengths free_lengths(int free_count, const std::vector<int>& rim_roles,
                         const std::vector<std::tuple<int, int, double>>& edges);

}  // namespace dd
