// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "systems/polyharmonic_system.h"

namespace dd {

/// Base surface B: constrained vertices stay where they are on S, the free ones take K q = 0 (§6,
/// "Base Surface Computation", there with K = L M⁻¹ L). positions: S, n×3. Returns q, n×3.
/// beside: other values at constrained vertices, n or none, which are solved for with it, as solves
/// take four columns at once. one_solve_error: of all, as of PolyharmonicSystem::extend().
Positions base_surface(const PolyharmonicSystem& bending, const Region& region,
                       const Positions& positions, const Eigen::VectorXd& beside = {},
                       double* one_solve_error = nullptr);

/// S after one step of implicit fairing, (M + tL) x = M p with t = (edge_lengths · mean edge)²:
/// the geometry on which K is built when its metric is to be smoothed. Throws UnsolvableSurface.
Positions faired_surface(const Mesh& mesh, const SurfaceOperators& operators, double edge_lengths);

/// Between S and its base: S smoothed over a length, (M + length⁴ L M⁻¹ L) x = M p on the free
/// vertices, constrained ones stay. Throws UnsolvableSurface.
Positions smoothed_surface(const Positions& positions, const SurfaceOperators& operators,
                           const Region& region, double length);

}  // namespace dd
