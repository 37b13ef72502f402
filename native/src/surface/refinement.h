// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "surface/factored_surface.h"

namespace dd {

/// Beyond the paper: rotations inferred from a linear base are too small where it bends far, so S'
/// shrinks. Each iteration takes the rotation R_j of every triangle from S to S' (15), smooths them
/// over the surface, and solves L p' = div(R_jᵀ) once more with the same factor. Smoothing is what
/// carries the bending; without it this is as-rigid-as-possible editing, which folds.
///
/// Triangles without a free corner keep the rotation that the handles give them: they are what the
/// smoothing hangs on.
///
/// The smoothing is kPasses means, each of the triangles around the vertices and then of the
/// vertices of the triangles. In between only the vertices are kept: what a pass makes of them is a
/// mean over their neighbours, which is half the work.
class Refinement {
 public:
  virtual ~Refinement() = default;
  /// offsets: the displacement of all rows, improved in the free ones.
  virtual void run(int iterations, Rows& offsets) = 0;
  virtual double bytes() const = 0;
};

/// In the precision of the Poisson system. surface must outlive it.
std::unique_ptr<Refinement> make_refinement(FactoredSurface& surface);

}  // namespace dd
