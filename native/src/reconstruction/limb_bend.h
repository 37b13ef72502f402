// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "reconstruction/cross_sections.h"
#include "reconstruction/factored_surface.h"

namespace dd {

/// Beyond the paper: the rotations of solid limbs according to their base. The base of a limb is as
/// thin as a thread, so that the rotations of its triangles about the thread are rounding. But it
/// has a direction, t at rest and t' in a pose. The even twist R_0 of LimbTwist takes t to R_0 t,
/// and the rotation
///
///   R_B = Q R_0,   Q: the shortest rotation from R_0 t to t'
///
/// bends a limb as its base does and twists it as the handles do.
class LimbBend {
 public:
  /// surface, sections: must outlive this. base: B at rest, n×3. solidity: above 0, to 1.
  LimbBend(const FactoredSurface& surface, const CrossSections& sections, const Positions& base,
           double solidity);

  /// rotations: unit quaternions by active index. Those of free vertices are replaced by R_B in the
  /// proportion of weights(). base: B', even: R_0, rows in the surface's order.
  template <class Real>
  void run(const Rows& base, const Rows& even, std::vector<Real>& rotations) const;

  /// R_B of a free vertex, with the sign of R_0.
  Eigen::Quaterniond rotation(const Rows& base, const Rows& even, Index free_row) const;
  /// Of free vertices, 0 to 1: how solid they are, less where the base has kept some thickness, so
  /// that its triangles have rotations of their own.
  const Eigen::VectorXd& weights() const { return weights_; }

  double bytes() const;

 private:
  struct Term {
    int row;
    double weight;
  };
  /// The base's derivative along t, in the proportion of its length at rest.
  Eigen::Vector3d derivative(const Rows& base, Index free_row) const;

  const FactoredSurface& surface_;
  std::vector<int> begin_;            // of the terms of each free vertex
  std::vector<Term> terms_;           // of the derivative
  Positions directions_;              // t, unit vectors
  Eigen::VectorXd weights_, swings_;  // swings_: the proportion of Q
};

}  // namespace dd
