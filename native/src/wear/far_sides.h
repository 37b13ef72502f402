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
  struct PointPatch {
    Eigen::RowVector3d position;
    PosedSurface::Patch patch;
  };
  /// surface: at rest; must outlive this. tree: over its triangles. count: of points. at_rest:
  /// gives point i at rest; called from several threads.
  FarSides(const PosedSurface& surface, const AabbTree& tree, int count,
           const std::function<PointPatch(int)>& at_rest, ThreadPool& pool);

  /// Outwardness of patch i in [0, 1], continuous in the pose: 1 at rest, 0 where it is folded up
  /// or turned over. It is max(a, b), with A the area of the patch projected along the direction
  /// from its opposite point, and S its own area:
  ///   a = (A / S) over the same at rest; squashing the patch in its plane doesn't change it,
  ///   b = (A / d²) over the same at rest, d the distance to the opposite point; bumps that rise
  ///       from the patch, and enlarge S alone, don't change it. d at rest over d counts as 3 at
  ///       most: where a body's sides are pressed together d goes to 0, and b would be 1 for a
  ///       patch that is folded up.
  /// 1 for a point without an opposite point, as on a sheet.
  double outwardness(int i, const PointPatch& posed) const;

 private:
  struct ProjectedPatch {
    double area;      // A
    double distance;  // d
  };
  ProjectedPatch projected(int i, const PointPatch& posed) const;

  struct OppositePoint {
    PointOnTriangle point;
    ProjectedPatch at_rest{0, 0};
    double projected_ratio = 1;  // A / S at rest
  };
  const PosedSurface& surface_;
  std::vector<OppositePoint> opposite_points_;
};

}  // namespace dd
