// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "methods/method.h"
#include "reconstruction/corner_flux.h"
#include "reconstruction/harmonic_blend.h"

namespace dd {

/// Gradient-based editing (DiffCoord; §2, Fig. 1d, 5). Harmonic weights propagate the rotations and
/// stretches of the handles over S, G'_j = G_j S_jᵀ, and (4) gives the surface. S_j is blended()
/// with the weights w_hj, the triangle's mean of w_h: L w_h = 0, w_h = 1 on handle h and 0 on all
/// other constrained vertices. Translating a handle doesn't rotate anything, a flaw that the paper
/// explains.
class GradientEditing : public Method {
 public:
  explicit GradientEditing(BoundSurface& bound);
  void update(const Frame& frame, const MethodOptions& options) override;
  double bytes() const override;

 private:
  BoundSurface& bound_;
  CornerFlux flux_;
  HarmonicBlend harmonic_;
  RowMatrix sums_;  // Σ_h w_h · blend_terms() at all vertices, rows in order()
};

}  // namespace dd
