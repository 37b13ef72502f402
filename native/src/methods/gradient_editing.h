// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "base/harmonic_blend.h"
#include "methods/method.h"
#include "reconstruction/corner_flux.h"

namespace dd {

/// DiffCoord (§2, Fig. 1d, 5): gradient-based editing. Rotation and stretch of the handles are
/// propagated over S by harmonic weights, G'_j = G_j S_jᵀ, and the surface follows from (4). S_j is
/// blended() of the triangle with L w_h = 0, w_h = 1 on handle h and 0 on all other
/// constrained vertices, w_hj its mean over the triangle. A handle that is only translated turns
/// nothing: the flaw that the paper explains.
class GradientEditing : public Method {
 public:
  explicit GradientEditing(BoundSurface& bound);
  void update(const Frame& frame, const MethodOptions& options) override;
  double bytes() const override;

 private:
  BoundSurface& bound_;
  CornerFlux flux_;
  HarmonicBlend harmonic_;
  RowMatrix sums_;  // of the blend's terms, at all vertices in order
};

}  // namespace dd
