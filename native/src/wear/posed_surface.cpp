// SPDX-License-Identifier: GPL-3.0-or-later
#include "wear/posed_surface.h"

#include <Eigen/Geometry>
#include <utility>

namespace dd {

PosedSurface::PosedSurface(Mesh at_rest, ThreadPool& pool)
    : mesh_(std::move(at_rest)), fans_(mesh_.triangles, mesh_.vertex_count()) {
  planes_.resize(mesh_.triangle_count(), 4);
  doubled_areas_.resize(mesh_.triangle_count());
  set_pose(mesh_.positions, pool);
}

void PosedSurface::set_pose(const Positions& posed, ThreadPool& pool) {
  mesh_.positions = posed;
  pool.parallel_for(planes_.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (Index j = begin; j < end; ++j) {
      const auto corner = [&](int k) -> Eigen::RowVector3d {
        return mesh_.positions.row(mesh_.triangles(j, k));
      };
      Eigen::RowVector3d normal = (corner(1) - corner(0)).cross(corner(2) - corner(0));
      const double doubled = normal.norm();
      if (doubled > 0) normal /= doubled;
      planes_.row(j) << normal, -normal.dot(corner(0));
      doubled_areas_[j] = doubled;
    }
  });
}

}  // namespace dd
