// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "reconstruction/base_gradients.h"
#include "reconstruction/refinement.h"

namespace dd {

/// Spacing of the coarse surface's vertices for a smoothing length. active_size: see
/// FactoredSurface.
double coarse_spacing(double length, double active_size);

/// Refinement on a CoarseSurface. Rotations are as smooth as the length over which they are
/// smoothed. Where that spans several edges, they are found on the coarse surface, starting from
/// the base's rotations there, at a fraction of the cost and interpolated; the surface itself is
/// solved for once, in the end. On the survey's cases the result is that of Refinement to 0.2% of
/// the box.
class CoarseRefinement : public RefinedFlux {
 public:
  /// Null where the coarse surface is not small enough, or the surface so small that full
  /// refinement is fast. base: B at rest, n×3. surface and base must outlive the result. length: of
  /// the smoothing, in the mesh's units.
  static std::unique_ptr<CoarseRefinement> make(FactoredSurface& surface, const Positions& base,
                                                double length);

  /// As Refinement::find(), but of offsets only the handles' rows are read.
  virtual void find(int iterations, const BasePose& pose, const Turning& turning,
                    const Rows& offsets) = 0;
  /// As Refinement::limb_base(), by active vertex of the surface itself.
  virtual Rows limb_base(const BasePose& pose, const Turning& turning) = 0;
  /// As Refinement::set_solidity(); the sections are those of coarse vertices on the surface.
  virtual void set_solidity(double solidity) = 0;
  virtual int vertex_count() const = 0;
  virtual double bytes() const = 0;
};

}  // namespace dd
