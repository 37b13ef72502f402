// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <vector>

#include "mesh/aabb_tree.h"
#include "transfer/posed_surface.h"

namespace dd {

/// Whether a body's surface still faces outwards, which in the inside of a bent joint, where it
/// folds and goes through itself, it doesn't: there no side of it is the outside. What is outwards
/// is told by the place that each point has at its back at rest, on the far side of the body, as
/// that keeps its side when the surface about the point turns over.
class FarSides {
 public:
  /// A point of the surface, and what lies about it.
  struct About {
    Eigen::RowVector3d place;
    PosedSurface::Patch patch;
  };
  /// surface: at rest; outlives this. tree: over it. at_rest: of each of so many points; called
  /// from several threads.
  FarSides(const PosedSurface& surface, const AabbTree& tree, int count,
           const std::function<About(int)>& at_rest, ThreadPool& pool);

  /// How much patch i faces outwards in the pose: 1 as at rest, 0 where it is folded up or turned
  /// over, continuously, the larger of two measures: how much of it points outwards, which what is
  /// only squashed keeps, and how much is left of what one sees of it from outside, which bumps
  /// that rise from it keep. 1 where nothing is at its back, as on a sheet.
  double outwardness(int i, const About& posed) const;

 private:
  struct Seen {
    double area;      // of the patch, from outside
    double distance;  // to the far side
  };
  Seen seen(int i, const About& posed) const;

  struct FarSide {
    PointOnTriangle point;
    Seen at_rest{0, 0};
    double share = 1;  // of the patch, that is seen at rest
  };
  const PosedSurface& surface_;
  std::vector<FarSide> far_;
};

}  // namespace dd
