// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "reconstruction/factored_surface.h"
#include "reconstruction/gradient_source.h"

namespace dd {

/// How handles move the base.
struct BasePose {
  const Rows& base;  ///< B', all rows in the surface's order
  /// The linear part of each handle's matrix, for parts whose base has no area anywhere.
  const std::vector<Eigen::Matrix3d>& linear;
};

/// The deformation gradients S_j of the base, from B to B' (15), or their rotations (§6).
class BaseGradients : public GradientSource {
 public:
  /// The pose must stay until the next one. The first one takes longer.
  virtual void take(const BasePose& pose, bool rotation_only) = 0;
  /// Triangles whose base has no area: another triangle, or a handle, stands in for them.
  virtual int stand_in_count() const = 0;
  virtual double bytes() const = 0;
};

/// In the precision of the Poisson system. base: B at rest, n×3. Both must outlive it.
std::unique_ptr<BaseGradients> make_base_gradients(const FactoredSurface& surface,
                                                   const Positions& base);

}  // namespace dd
