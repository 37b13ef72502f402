// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "surface/bound_surface.h"
#include "surface/gradient_source.h"

namespace dd {

/// The deformation gradients S_j of the base, from B to B' (15), or their rotations (§6).
class BaseGradients : public GradientSource {
 public:
  /// Takes a pose, which must stay until the next one. base: B', all rows in order. linear: the
  /// linear part of each handle's matrix, for parts whose base has no area anywhere.
  virtual void take(const Rows& base, const std::vector<Eigen::Matrix3d>& linear,
                    bool rotation_only) = 0;
  /// Triangles whose base has no area: another triangle, or a handle, stands in for them.
  virtual int stand_in_count() const = 0;
  virtual double bytes() const = 0;
};

/// In the precision of the Poisson system.
std::unique_ptr<BaseGradients> make_base_gradients(const BoundSurface& bound);

}  // namespace dd
