// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "systems/polyharmonic_system.h"

namespace dd {

/// Base surface B: solves K q = 0 at the free vertices, with the constrained ones at their
/// positions on S (§6, "Base Surface Computation", there with K = L M⁻¹ L). positions: S, n×3.
/// Returns q, n×3. fourth_column: n values or none, a fourth column of boundary values that is
/// solved for in the same pass; only its effect on single_solve_error is kept. single_solve_error:
/// as PolyharmonicSystem::extend() returns it, the largest of the four columns.
Positions base_surface(const PolyharmonicSystem& bending, const Region& region,
                       const Positions& positions, const Eigen::VectorXd& fourth_column = {},
                       double* single_solve_error = nullptr);

/// S after one step of implicit fairing, (M + tL) x = M p with t = (edge_lengths · mean edge)²: the
/// geometry on which K is built if BindOptions::metric_smoothing > 0. Throws UnsolvableSurface.
Positions faired_surface(const Mesh& mesh, const SurfaceOperators& operators, double edge_lengths);

/// A surface between S and B: S smoothed over a length, (M + length⁴ L M⁻¹ L) x = M p on the free
/// vertices, with the constrained ones at their positions on S. Throws UnsolvableSurface.
Positions smoothed_surface(const Positions& positions, const SurfaceOperators& operators,
                           const Region& region, double length);

}  // namespace dd
