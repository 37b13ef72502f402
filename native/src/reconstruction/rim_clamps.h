// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "reconstruction/factored_surface.h"
#include "reconstruction/gradient_source.h"

namespace dd {

/// Solves (14) so that the slope is held at rims: the system of ClampedPoisson.
class RimClamps {
 public:
  virtual ~RimClamps() = default;
  /// offsets: as of PoissonSystem::solve(). weight: of the clamped solution against that of (14), 0
  /// to 1.
  virtual void solve(const FluxSource& source, double weight, Rows& offsets) = 0;
  /// The clamped solution, by a correction of the present offsets.
  virtual void step(const FluxSource& source, Rows& offsets) = 0;
  /// Of the clamps, in the mesh's units.
  virtual double length() const = 0;
  virtual double bytes() const = 0;
};

/// On the surface itself, or where that is large by CoarseClamps. surface must outlive the result.
/// Throws UnsolvableSurface.
std::unique_ptr<RimClamps> make_rim_clamps(FactoredSurface& surface, double length);

}  // namespace dd
