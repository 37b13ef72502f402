// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "reconstruction/cross_sections.h"
#include "reconstruction/factored_surface.h"
#include "reconstruction/limb_bend.h"

namespace dd {

/// Beyond the paper: a base of solid limbs that shows them. B is a thread there; what is shown is
///
///   B + a at rest,   B' + R_B a in a pose,
///
/// a = s (Ŝ − B), with s how solid the surface is, Ŝ the surface smoothed over a part of a limb's
/// radius, which loses its relief and keeps its thickness, and R_B the rotation by LimbBend.
class LimbBase {
 public:
  /// surface: must outlive this. base: B at rest, n×3. solidity: above 0, to 1.
  LimbBase(const FactoredSurface& surface, const CrossSections& sections, const Positions& base,
           double solidity);

  /// R_B a of the active vertices; of rims 0. base: B', even: R_0, rows in the surface's order.
  Rows offsets(const LimbBend& bend, const Rows& base, const Rows& even) const;

  double bytes() const { return static_cast<double>(offsets_.size() * Index(sizeof(double))); }

 private:
  const FactoredSurface& surface_;
  Positions offsets_;  // a, of free rows
};

}  // namespace dd
