// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "reconstruction/factored_surface.h"
#include "reconstruction/gradient_source.h"
#include "reconstruction/rotation_smoothing.h"
#include "reconstruction/turning.h"

namespace dd {

/// Beyond the paper: rotations inferred from a linear base are too small where it bends far, so S'
/// shrinks. Each iteration takes the rotation of every triangle from S to S' (15), and of every
/// vertex the mean of its triangles', weighted by area; smooths these over a length
/// (RotationSmoothing); solves L p' = div(R_jᵀ) with R_j the mean of the triangle's corners; and
/// goes there, or beyond. Smoothing is what carries the bending; without it this is
/// as-rigid-as-possible editing, which folds.
///
/// A rim's vertex has the rotation of the triangles that its handle alone moves: they are what the
/// smoothing hangs on. Where the handle has none, as when it is one vertex, the mean of all around.
///
/// This finds the rotations. The last solve with them is a FluxSource's like any other.
class Refinement : public FluxSource {
 public:
  /// offsets: the displacement of all rows, where it starts, and left where the last but one
  /// solution is. What is found stays until the next call.
  virtual void find(int iterations, const Turning& turning, Rows& offsets) = 0;
  /// The same of a pose of S in place of S: what turns are those of a triangle there, and what is
  /// turned are the pose's gradients. posed: the displacement of all rows, kept only for the call
  /// and what follows it.
  virtual void find_from(const Rows& posed, int iterations, Rows& offsets) = 0;
  /// Of the active vertices, in their order: unit quaternions, but shorter where smoothing left
  /// them so.
  virtual Rows rotations() const = 0;
  virtual double bytes() const = 0;
};

/// How much of the smoothing the last of so many iterations has. What is found at rest depends on
/// nothing else of their number.
double last_smoothing(int iterations);

/// In the precision of the Poisson system. surface must outlive it. length, masses: see
/// RotationSmoothing.
std::unique_ptr<Refinement> make_refinement(FactoredSurface& surface, double length,
                                            const Eigen::VectorXd& masses);

}  // namespace dd
