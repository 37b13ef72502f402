// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "reconstruction/cross_section_arms.h"
#include "reconstruction/cross_sections.h"
#include "reconstruction/factored_surface.h"
#include "reconstruction/gradient_source.h"
#include "reconstruction/rotation_smoothing.h"
#include "reconstruction/turning.h"

namespace dd {

/// The right-hand side of the last solve of a refinement. Where limbs are solid, the solution is of
/// the centres of their sections, see CrossSections.
class RefinedFlux : public FluxSource {
 public:
  virtual const CrossSectionArms& arms() const = 0;
  /// How solid the surface is at each free row, 0 to 1; empty: it isn't.
  virtual const Eigen::VectorXd& solidity() const = 0;
};

/// Beyond the paper: rotations inferred from a linear base are too small where it bends far, so S'
/// shrinks. Each iteration takes the rotation of every triangle from S to S' (15), and at every
/// vertex their mean weighted by area. It smooths these over a length (RotationSmoothing), solves L
/// p' = div(R_jᵀ), R_j the mean of the triangle's corners, and over-relaxes. Smoothing is what
/// carries the bending; without it this is as-rigid-as-possible editing, which folds.
///
/// A rim vertex takes the mean over triangles without free corners, which its handle alone moves:
/// these are the boundary values of the smoothing. Where it has none, as in a handle of one vertex,
/// it takes the mean over its whole one-ring.
///
/// This class finds the rotations; as a FluxSource it provides the right-hand side of the last
/// solve.
///
/// Solid limbs have sections, over which rotations are averaged before they are smoothed, over a
/// length that rises with the length of the arm. The first rotations of limbs are those of
/// LimbBend, where the base is known.
class Refinement : public RefinedFlux {
 public:
  /// Before the first find(). sections: must outlive this; null: there are none. solidity: 0, a
  /// hollow skin, to 1.
  virtual void set_solidity(const CrossSections* sections, double solidity) = 0;
  /// base: B', rows in the surface's order; read where limbs are solid. offsets: displacements of
  /// all rows; in: the start, out: the solution of the last but one iteration. The rotations stay
  /// until the next call.
  virtual void find(int iterations, const Rows& base, const Turning& turning, Rows& offsets) = 0;
  /// The same with a pose of S in place of S: rotations are those from the pose to S', and they
  /// turn the pose's gradients. posed: displacements of all rows.
  virtual void find_from(const Rows& posed, int iterations, Rows& offsets) = 0;
  /// What LimbBase adds to B', by active vertex; without rows where no limb is solid or the
  /// handles' turns are not known.
  virtual Rows limb_base(const Rows& base, const Turning& turning) = 0;
  /// By active vertex: unit quaternions, but shorter where smoothing averaged different ones.
  virtual Rows rotations() const = 0;
  virtual double bytes() const = 0;
};

/// The fraction of the smoothing in the last of so many iterations. The right-hand side at rest
/// depends on the number of iterations through it alone.
double last_smoothing(int iterations);

/// Computes in the precision of the Poisson system. surface and base must outlive the result. base:
/// B at rest, n×3; null: not known. length, masses: see RotationSmoothing. both_diagonals: whether
/// solid limbs take means over OtherDiagonals, too, which takes a tenth longer.
std::unique_ptr<Refinement> make_refinement(FactoredSurface& surface, const Positions* base,
                                            double length, const Eigen::VectorXd& masses,
                                            bool both_diagonals);

}  // namespace dd
