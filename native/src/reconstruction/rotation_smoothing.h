// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "reconstruction/factored_surface.h"

namespace dd {

/// Smooths a field of rotations over a length: (M + tL) q = M q₀ on the free vertices, t = length²,
/// q₀ unit quaternions, with given values at rims. It does not depend on the mesh's density,
/// because M and L measure the surface: a wave of wavelength 2πλ (an eigenfunction of the
/// Laplacian) is damped to 1/(1 + (length/λ)²).
class RotationSmoothing {
 public:
  /// length: in the mesh's units. masses: M, by vertex; c times the surface's own masses reduce the
  /// length to length/√c. surface must outlive this. Throws UnsolvableSurface.
  RotationSmoothing(const FactoredSurface& surface, double length, const Eigen::VectorXd& masses);

  /// quaternions: rows of 4, free vertices in the surface's order, then the Poisson system's rims;
  /// neighbours must have like signs. Free rows are overwritten with smoothed ones, which are
  /// shorter than 1 where neighbours differ. fraction: of the way from given to smoothed
  /// values.
  template <class Real>
  void run(Real* quaternions, double fraction = 1);

  double bytes() const;

 private:
  struct Coupling {
    int row, rim;
    double weight;
  };

  const PoissonSystem& poisson_;
  std::unique_ptr<SparseCholesky> factor_;
  Eigen::VectorXd masses_;           // of free rows
  std::vector<Coupling> couplings_;  // −tL between free rows and rims
  Rows right_;
  SparseCholesky::SolveScratch scratch_;
};

}  // namespace dd
