// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "support/types.h"

namespace dd {

/// A right-hand side of (14).
class FluxSource {
 public:
  virtual ~FluxSource() = default;

  /// Adds div(S_jᵀ) (14) of the active triangles of a section to the rows of a right-hand side, see
  /// PoissonSystem::solve().
  virtual void add(int section, double* rows) const = 0;
  /// The sum of add() over all sections in the rest pose, by the same arithmetic, so that at rest
  /// the difference vanishes to the last digits.
  virtual const Rows& at_rest() const = 0;
};

/// Deformation gradients S_j, from a base, handles, another mesh or examples: the interface through
/// which a Reconstruction reads them.
class GradientSource : public FluxSource {
 public:
  /// S_j of one of the mesh's own triangles with a free corner, for the formulation with fourth
  /// points (10).
  virtual Eigen::Matrix3d at(int triangle) const = 0;
};

}  // namespace dd
