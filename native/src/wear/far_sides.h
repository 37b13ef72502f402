// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <vector>

#include "mesh/aabb_tree.h"
#include "wear/posed_surface.h"

namespace dd {

/// How far each point of a body's surface still faces outwards in a pose. In the crease of a bent
/// joint the surface folds and passes through itself, so its normal no longer tells outside from
/// inside. The reference direction of a point is therefore taken from its opposite point: where the
/// ray against its normal leaves the body at rest. That point stays on the other side of the body
/// also where the surface around the first one turns over.
class FarSides {
 public:
  /// A point of the surface and the triangles around it.
  struct About {
    Eigen::RowVector3d place;
    PosedSurface::Patch patch;
  };
  /// surface: at rest; must outlive this. tree: over its triangles. count: of points. at_rest:
  /// gives point i at rest; called from several threads.
  FarSides(const PosedSurface& surface, const AabbTree& tree, int count,
           const std::function<About(int)>& at_rest, ThreadPool& pool);

  /// Outwardness of patch i in [0, 1], continuous in the pose: 1 at rest, 0 where it is folded up
  /// or turned over. It is max(a, b), with A the area of the patch projected along the direction
  /// from its opposite point, and S its own area:
  ///   a = (A / S) over the same at rest; squashing the patch in its plane doesn't change it,
  ///   b = (A / d²) over the same at rest, d the distance to the opposite point; bumps that rise
  ///       from the patch, and enlarge S alone, don't change it.
  /// 1 for a point without an opposite point, as on a sheet.
  double outwardness(int i, const About& posed) const;

 private:
  struct Seen {
    double area;      // A
    double distance;  // d
  };
  Seen seen(int i, const About& posed) const;

  struct FarSide {
    PointOnTriangle point;
    Seen at_rest{0, 0};
    double share = 1;  // A / S at rest
  };
  const PosedSurface& surface_;
  std::vector<FarSide> far_;
};

}  // namespace dd
