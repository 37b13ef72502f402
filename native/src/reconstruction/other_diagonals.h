// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <utility>
#include <vector>

#include "systems/operators.h"

namespace dd {

/// Pairs of triangles that the cotangent Laplacian does not tell from those along the other
/// diagonal of their quad, as the corners lie on a circle: the edge between them has no weight. All
/// quads of a grid are like that. Quantities of such triangles depend on how the quads were cut,
/// and a shape that is symmetric but for that stays symmetric only if both ways count alike.
struct OtherDiagonals {
  Triangles triangles;       ///< 2q and 2q + 1 are those of quad q, cut the other way
  std::vector<int> quad_of;  ///< of each triangle of the surface; -1: of none
};

/// positions: n×3. active: the triangles considered.
OtherDiagonals other_diagonals(const Positions& positions, const SurfaceOperators& operators,
                               const std::vector<int>& active);

}  // namespace dd
