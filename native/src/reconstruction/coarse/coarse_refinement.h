// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "reconstruction/base_gradients.h"
#include "reconstruction/refinement.h"

namespace dd {

/// The rotations that a refinement looks for are as smooth as the length over which it smooths
/// them. Where that is several edges they are found on a CoarseSurface, from the rotations of the
/// base there on, at a fraction of the cost, and the surface itself is solved for once, with these
/// rotations. Its result is that of Refinement to 0.2% of the box.
class CoarseRefinement : public FluxSource {
 public:
  /// Null where it would gain little, or where a whole refinement takes no time either. base: B at
  /// rest, n×3. Both must outlive it. length: of the smoothing, in the mesh's units.
  static std::unique_ptr<CoarseRefinement> make(FactoredSurface& surface, const Positions& base,
                                                double length);

  /// As Refinement::find(), but offsets are those of handles alone.
  virtual void find(int iterations, const BasePose& pose, const Turning& turning,
                    const Rows& offsets) = 0;
  virtual int vertex_count() const = 0;
  virtual double bytes() const = 0;
};

}  // namespace dd
