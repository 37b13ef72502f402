// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "kernels/kernels.h"
#include "reconstruction/cross_section_arms.h"
#include "reconstruction/factored_surface.h"

namespace dd {

/// Where a section bends sharply, turning arms makes triangles of its inside turn over. In terms of
/// the surface, centres and arms of CrossSections add to the rotated gradients those of the arms:
///
///   L p' = div(R ∇p + E),   E = ∇(R r) − R ∇r.
///
/// This adds (λ − 1) div(E) to the right-hand side, per triangle: λ = 1 where R + E keeps the area
/// in R's plane, so also under the shear of a twist, and less where it would compress that to less
/// than a fraction of it.
template <class Real>
class FoldLimits {
 public:
  explicit FoldLimits(const FactoredSurface& surface) : surface_(surface) {}

  /// Takes the arms before they are turned, at positions (p, rows in the surface's order): of rest
  /// or of a pose.
  void take(const Rows& positions, const CrossSectionArms& arms);

  /// As the add of PoissonSystem::solve(). quaternions: R by active index. arms: turned by it.
  void add(const Real* quaternions, const CrossSectionArms& arms, int section, double* rows) const;

  double bytes() const {
    return static_cast<double>(blocks_.size() * sizeof(ArmBlock<Real>) +
                               (triangles_.size() + begin_.size()) * sizeof(int));
  }

 private:
  /// Adds (λ − 1) div(E) of the triangle in a lane, of which the given fraction of its area would
  /// be left.
  void limit(int number, double area, const Real* quaternions, const CrossSectionArms& arms,
             int section, double* rows) const;

  const FactoredSurface& surface_;
  std::vector<ArmBlock<Real>> blocks_;  // of the triangles that have an arm
  std::vector<int> triangles_;          // of each lane; -1: none
  std::vector<int> begin_;              // blocks by section
};

}  // namespace dd
