// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "surface/factored_surface.h"
#include "surface/gradient_source.h"
#include "surface/rotation_smoothing.h"
#include "systems/clamped_poisson.h"

namespace dd {

/// How far the handles turn the surface.
struct Turning {
  /// Rows of 4 in the surface's order, a field of quaternions that neighbours agree on and that
  /// comes within half a turn of what the surface does; null: no part turns by more than half a
  /// turn.
  const Rows* gauge = nullptr;
  /// That nothing is known of it, as of a base from outside: what the surface does before it is
  /// refined is followed from vertex to vertex.
  bool unknown = false;
  /// How much of the refinement is to have an effect, 0 to 1: far turns leave less and less room,
  /// and it would pinch the inside of a bend and wring a twist to a thread.
  double share = 1;
  /// Rotations that are known without a base, and how much they count in the result that is
  /// refined, 0 to 1: a base that is as thin as a thread tells little of how it bends.
  const GradientSource* known = nullptr;
  double known_share = 0;
};

/// Beyond the paper: rotations inferred from a linear base are too small where it bends far, so S'
/// shrinks. Each iteration takes the rotation of every triangle from S to S' (15), and of every
/// vertex the mean of its triangles', weighted by area; smooths these over a length
/// (RotationSmoothing); solves L p' = div(R_jᵀ) with R_j the mean of the triangle's corners; and
/// goes there, or beyond. Smoothing is what carries the bending; without it this is
/// as-rigid-as-possible editing, which folds.
///
/// A rim's vertex has the rotation of the triangles that its handle alone moves: they are what the
/// smoothing hangs on. Where the handle has none, as when it is one vertex, the mean of all around.
class Refinement {
 public:
  virtual ~Refinement() = default;
  /// offsets: the displacement of all rows, improved in the free ones. clamped: makes the last
  /// solve in place of the Poisson system, or null.
  virtual void run(int iterations, ClampedPoisson* clamped, const Turning& turning,
                   Rows& offsets) = 0;
  virtual double length() const = 0;
  virtual double bytes() const = 0;
};

/// In the precision of the Poisson system. surface must outlive it. length: of the smoothing, in
/// the mesh's units.
std::unique_ptr<Refinement> make_refinement(FactoredSurface& surface, double length);

}  // namespace dd
