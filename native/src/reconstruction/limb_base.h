// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "reconstruction/cross_sections.h"
#include "reconstruction/factored_surface.h"
#include "reconstruction/limb_bend.h"
#include "reconstruction/rotation_smoothing.h"

namespace dd {

/// Beyond the paper: a base of solid limbs that shows them. B is a thread there, and near rims a
/// tube that twists otherwise. With c the means of B over cross-sections, smoothed along the limb,
/// and Ŝ the surface smoothed over a part of a limb's radius, which loses its relief and keeps its
/// thickness,
///
///   B + s (Ŝ − B) at rest,   B' + s (c' + R_B (Ŝ − c) − B') in a pose
///
/// is shown, s how solid the surface is and R_B the rotation by LimbBend.
class LimbBase {
 public:
  /// surface, sections: must outlive this. base: B at rest, n×3. solidity: above 0, to 1.
  LimbBase(const FactoredSurface& surface, const CrossSections& sections, const Positions& base,
           double solidity);

  /// What is added to B', of the active vertices; of rims 0. base: B', even: R_0, rows in the
  /// surface's order.
  Rows offsets(const LimbBend& bend, const Rows& base, const Rows& even) const;

  double bytes() const {
    return static_cast<double>((arms_.size() + shares_.size()) * Index(sizeof(double))) +
           (along_ ? along_->bytes() : 0);
  }

 private:
  /// c of all active vertices.
  Rows centres(const Rows& base) const;

  const FactoredSurface& surface_;
  const CrossSections& sections_;
  std::unique_ptr<RotationSmoothing> along_;  // of c; vertices without a section don't count
  Positions arms_;                            // Ŝ − c, of free rows
  Eigen::VectorXd shares_;                    // s, of free rows
};

}  // namespace dd
