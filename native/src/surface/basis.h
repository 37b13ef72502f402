// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "support/progress.h"
#include "systems/poisson_system.h"
#include "systems/polyharmonic_system.h"

namespace dd {

/// An affine motion x ↦ A x of each handle displaces the base by a field that is linear in the
/// handles' matrices (§6, after Botsch and Kobbelt 2004), so that a frame needs no solve for it:
///
///   δq = W C,   C = for each handle the 4×3 block [(A_lin − I)ᵀ; A o − o],  o its centre.
///
/// The columns of W are 4 functions a handle: the extensions of the handle's own coordinates
/// (about its centre, for accuracy) and of 1, zero at all other constrained vertices.
struct HandleBasis {
  Positions centres;  ///< h×3, mean of each handle's vertices
  RowMatrix weights;  ///< F×4h, rows as in the given order
};
/// progress is told how far it is, from 0 to 1.
HandleBasis handle_basis(const PolyharmonicSystem& bending, const Region& region,
                         const Positions& positions, const RowOrder& order,
                         const std::function<void(double)>& progress = {});

/// The mean of each handle's vertices, h×3.
Positions handle_centres(const Region& region, const Positions& positions);

/// The 4 values of one handle's functions at one of its own vertices: (x − o, 1).
inline Eigen::RowVector4d handle_coordinates(const Positions& positions, int vertex,
                                             const Positions& centres, int handle) {
  Eigen::RowVector4d coordinates;
  coordinates << positions.row(vertex) - centres.row(handle), 1.0;
  return coordinates;
}

}  // namespace dd
