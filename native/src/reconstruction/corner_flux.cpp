// SPDX-License-Identifier: GPL-3.0-or-later
#include "reconstruction/corner_flux.h"

#include <numeric>

namespace dd {

namespace {

std::vector<int> all_of(const ActiveTriangles& active) {
  std::vector<int> all(static_cast<size_t>(active.size()));
  std::iota(all.begin(), all.end(), 0);
  return all;
}

}  // namespace

CornerFlux::CornerFlux(const FactoredSurface& surface)
    : CornerFlux(surface, all_of(surface.poisson->active())) {}

CornerFlux::CornerFlux(const FactoredSurface& surface, const std::vector<int>& chosen) {
  const PoissonSystem& poisson = *surface.poisson;
  const ActiveTriangles& active = poisson.active();
  const Triangles& t = surface.operators.triangles;
  size_t next = 0;
  for (int section = 0; section < active.sections(); ++section) {
    begin_.push_back(static_cast<int>(next));
    for (; next < chosen.size() && chosen[next] < active.begin[section + 1]; ++next) {
      Corners corners;
      corners.triangle = active.triangles[chosen[next]];
      corners.flux =
          corner_divergences(surface.operators.metric, surface.mesh.positions, t, corners.triangle);
      for (int k = 0; k < 3; ++k)
        corners.target[k] = poisson.right_hand_side_row(section, t(corners.triangle, k));
      corners_.push_back(corners);
    }
  }
  begin_.push_back(static_cast<int>(next));
}

}  // namespace dd
