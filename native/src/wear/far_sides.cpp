// SPDX-License-Identifier: GPL-3.0-or-later
#include "wear/far_sides.h"

#include <algorithm>
#include <cmath>

namespace dd {

namespace {

// Least A / S at rest: a point on a more creased patch is treated as one without an opposite point.
constexpr double kMinProjectedRatio = 0.3;
// Least distance of the opposite point, as a fraction of the patch's size √(2 area). Safety: a
// creased patch would be its own opposite.
constexpr double kMinOppositeDistance = 0.01;
// Least d, as a fraction of d at rest. Safety: no direction is defined at 0.
constexpr double kMinRelativeDistance = 0.01;
// Largest ratio of d at rest to d in b: bounds how much b makes of opposite sides that come
// together.
constexpr double kMaxDistanceRatio = 3;

}  // namespace

FarSides::FarSides(const PosedSurface& surface, const AabbTree& tree, int count,
                   const std::function<PointPatch(int)>& at_rest, ThreadPool& pool)
    : surface_(surface), opposite_points_(static_cast<size_t>(count)) {
  pool.parallel_for(count, kLeastRange, [&](int64_t begin, int64_t end) {
    for (int i = static_cast<int>(begin); i < end; ++i) {
      const PointPatch here = at_rest(i);
      OppositePoint& opposite = opposite_points_[size_t(i)];
      opposite.point = tree.first_exit(here.position.transpose(), -here.patch.normal.transpose(),
                                       {kMinOppositeDistance * std::sqrt(here.patch.area)});
      if (opposite.point.triangle < 0) continue;
      opposite.at_rest = projected(i, here);
      opposite.projected_ratio = opposite.at_rest.area / here.patch.area;
      if (!(opposite.projected_ratio >= kMinProjectedRatio)) opposite.point.triangle = -1;
    }
  });
}

FarSides::ProjectedPatch FarSides::projected(int i, const PointPatch& posed) const {
  const OppositePoint& opposite = opposite_points_[size_t(i)];
  const Mesh& mesh = surface_.mesh();
  const Eigen::RowVector3d outwards =
      posed.position - position_of(opposite.point, mesh.positions, mesh.triangles);
  const double distance =
      std::max(outwards.norm(), kMinRelativeDistance * opposite.at_rest.distance);
  return {posed.patch.normal.dot(outwards) / distance, distance};
}

double FarSides::outwardness(int i, const PointPatch& posed) const {
  const OppositePoint& opposite = opposite_points_[size_t(i)];
  if (opposite.point.triangle < 0) return 1;
  const ProjectedPatch now = projected(i, posed);
  if (!(now.area > 0)) return 0;
  const double scale = std::min(opposite.at_rest.distance / now.distance, kMaxDistanceRatio);
  return std::min(1.0, std::max(now.area / (opposite.projected_ratio * posed.patch.area),
                                scale * scale * now.area / opposite.at_rest.area));
}

}  // namespace dd
