// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "support/types.h"

namespace dd {

/// What a surface is made of by (14).
class FluxSource {
 public:
  virtual ~FluxSource() = default;

  /// Adds div(S_jᵀ) (14) of the active triangles of a section to the rows of a right-hand side, as
  /// PoissonSystem::solve() asks.
  virtual void add(int section, double* rows) const = 0;
  /// What add() gives where nothing moves, in the same arithmetic: both cancel to the last digits.
  virtual const Rows& at_rest() const = 0;
};

/// Where deformation gradients S_j come from: a base, handles, another mesh, examples. What makes a
/// surface of them asks for no more than this.
class GradientSource : public FluxSource {
 public:
  /// S_j of a triangle of the mesh with a free corner, for the formulation with fourth points (10).
  virtual Eigen::Matrix3d at(int triangle) const = 0;
};

}  // namespace dd
