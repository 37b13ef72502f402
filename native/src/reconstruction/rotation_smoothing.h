// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "reconstruction/factored_surface.h"

namespace dd {

/// A field of rotations, smoothed over a length: (M + tL) q = M q₀ on the free vertices, t =
/// length², q₀ unit quaternions, given on rims. The same at any density, because M and L measure
/// the surface. On a surface of even curvature a wave of wavelength 2πλ keeps 1/(1 + (length/λ)²)
/// of itself.
class RotationSmoothing {
 public:
  /// length: in the mesh's units. masses: M, by vertex; where it isn't the surface's own mass the
  /// length is less by the root of what it is more. surface must outlive it. Throws
  /// UnsolvableSurface.
  RotationSmoothing(const FactoredSurface& surface, double length, const Eigen::VectorXd& masses);

  /// quaternions: rows of 4, free vertices in the surface's order, then the Poisson system's rims.
  /// Signs are such that neighbours agree. Free rows come out smoothed and shorter than 1 where
  /// they differ from those around. share: of the way from given to smoothed.
  template <class Real>
  void run(Real* quaternions, double share = 1);

  double bytes() const;

 private:
  struct Pull {
    int row, rim;
    double weight;
  };

  const PoissonSystem& poisson_;
  std::unique_ptr<SparseCholesky> factor_;
  Eigen::VectorXd masses_;   // of free rows
  std::vector<Pull> pulls_;  // −tL between free rows and rims
  Rows right_;
  SparseCholesky::Space space_;
};

}  // namespace dd
