// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "reconstruction/gradient_source.h"
#include "reconstruction/rotated_flux_pass.h"

namespace dd {

/// Gradients of S, or of its base at rest, rotated by a field of rotations, as a source for (14).
class RotatedFlux : public GradientSource {
 public:
  /// of: n×3, the positions. rotations: quaternions in the surface's order; must outlive this, and
  /// may change between solves.
  RotatedFlux(const FactoredSurface& surface, const Positions& of, const Rows& rotations);
  void add(int section, double* rows) const override {
    pass_.add(rotations_.data(), section, rows);
  }
  const Rows& at_rest() const override { return at_rest_; }
  Eigen::Matrix3d at(int triangle) const override;
  double bytes() const;

 private:
  const FactoredSurface& surface_;
  const Rows& rotations_;
  RotatedFluxPass<double> pass_;
  Rows at_rest_;
};

}  // namespace dd
