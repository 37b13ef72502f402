// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "reconstruction/cross_sections.h"
#include "reconstruction/harmonic_blend.h"
#include "reconstruction/turning.h"

namespace dd {

/// Beyond the paper: distributes the twist of a limb evenly along its length. On a skin, harmonic
/// weights w_h of the handles change the faster, the shorter the way around the limb is, and a base
/// by displacements has its twist in the middle; a tapered limb would be wrung where it is thin.
///
/// Here weights are harmonic for a conductivity, div(k ∇w_h) = 0, that is the inverse of the limb's
/// radius, so that the way around it cancels: on a straight limb w_h is linear in its length. They
/// blend the handles' rotations to R_0. Of the part of a rotation R that R_0 leaves, R_0⁻¹ R, the
/// twist about the limb's axis is removed; how the limb bends remains.
class LimbTwist {
 public:
  /// surface, sections: must outlive this. solidity: above 0, to 1; the exponent of the
  /// conductivity.
  LimbTwist(const FactoredSurface& surface, const CrossSections& sections, double solidity);
  ~LimbTwist();

  /// Sets R_0 of a pose.
  void take(const HandleTurns& turns);
  /// R_0 as quaternions with continuous signs, rows in the surface's order. Of what is fixed: I.
  const Rows& even() const { return even_; }
  /// rotations: unit quaternions by active index; those of free vertices are replaced where limbs
  /// are solid, with the signs of R_0. weight: 0 to 1, how much of the twist is removed.
  template <class Real>
  void run(std::vector<Real>& rotations, double weight) const;

  double bytes() const;

 private:
  class Conduction;

  const FactoredSurface& surface_;
  const CrossSections& sections_;
  double solidity_;
  std::unique_ptr<Conduction> conduction_;
  HarmonicBlend blend_;
  Rows even_;
};

}  // namespace dd
