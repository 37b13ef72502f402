// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "reconstruction/factored_surface.h"
#include "reconstruction/gradient_source.h"

namespace dd {

/// A pose of the base.
struct BasePose {
  const Rows& base;  ///< B', all rows in PoissonSystem::order()
  /// The linear part of each handle's matrix, the gradient of components whose base has no area.
  const std::vector<Eigen::Matrix3d>& linear;
};

/// The deformation gradients S_j of the base, from B to B' (15), or their rotations (§6).
class BaseGradients : public GradientSource {
 public:
  /// pose.base must stay valid until the next call. The first call builds the passes over
  /// triangles, which takes longer.
  virtual void take(const BasePose& pose, bool rotation_only) = 0;
  /// The number of active triangles whose base has no area: they take the gradient of another
  /// triangle or of a handle, or I.
  virtual int stand_in_count() const = 0;
  virtual double bytes() const = 0;
};

/// Computes in the precision of the Poisson system. base: B at rest, n×3. surface and base must
/// outlive the result.
std::unique_ptr<BaseGradients> make_base_gradients(const FactoredSurface& surface,
                                                   const Positions& base);

}  // namespace dd
