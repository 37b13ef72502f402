// SPDX-License-Identifier: GPL-3.0-or-later
#include "wear/far_sides.h"

#include <algorithm>
#include <cmath>

namespace dd {

namespace {

// Least A / S at rest: a point on a more creased patch is treated as one without an opposite point.
constexpr double kCreased = 0.3;
// Least distance of the opposite point, as a fraction of the patch's size √(2 area). Safety: a
// creased patch would be its own opposite.
constexpr double kLeastDepth = 0.01;
// Least d, as a fraction of d at rest. Safety: no direction is defined at 0.
constexpr double kLeastDistance = 0.01;
// Largest ratio of d at rest to d in b: bounds how much b makes of opposite sides that come
// together.
constexpr double kMostShrunk = 3;

}  // namespace

FarSides::FarSides(const PosedSurface& surface, const AabbTree& tree, int count,
                   const std::function<About(int)>& at_rest, ThreadPool& pool)
    : surface_(surface), far_(static_cast<size_t>(count)) {
  pool.parallel_for(count, kLeastRange, [&](int64_t begin, int64_t end) {
    for (int i = static_cast<int>(begin); i < end; ++i) {
      const About here = at_rest(i);
      FarSide& far = far_[size_t(i)];
      far.point = tree.exit(here.place.transpose(), -here.patch.normal.transpose(),
                            kLeastDepth * std::sqrt(here.patch.area));
      if (far.point.triangle < 0) continue;
      far.at_rest = seen(i, here);
      far.share = far.at_rest.area / here.patch.area;
      if (!(far.share >= kCreased)) far.point.triangle = -1;
    }
  });
}

FarSides::Seen FarSides::seen(int i, const About& posed) const {
  const FarSide& far = far_[size_t(i)];
  const Mesh& mesh = surface_.mesh();
  const Eigen::RowVector3d outwards =
      posed.place - place_of(far.point, mesh.positions, mesh.triangles);
  const double distance = std::max(outwards.norm(), kLeastDistance * far.at_rest.distance);
  return {posed.patch.normal.dot(outwards) / distance, distance};
}

double FarSides::outwardness(int i, const About& posed) const {
  const FarSide& far = far_[size_t(i)];
  if (far.point.triangle < 0) return 1;
  const Seen now = seen(i, posed);
  if (!(now.area > 0)) return 0;
  const double scale = std::min(far.at_rest.distance / now.distance, kMostShrunk);
  return std::min(1.0, std::max(now.area / (far.share * posed.patch.area),
                                scale * scale * now.area / far.at_rest.area));
}

}  // namespace dd
