// SPDX-License-Identifier: GPL-3.0-or-later
#include "base/carried_components.h"

#include <Eigen/Geometry>
#include <utility>

#include "mesh/unit_box.h"
#include "reconstruction/components.h"
#include "support/rotations.h"

namespace dd {

namespace {

Eigen::RowVector3d centroid(const Rows& rows, const Triangles& t, Index j) {
  return (rows.row(t(j, 0)) + rows.row(t(j, 1)) + rows.row(t(j, 2))).head<3>() / 3;
}

}  // namespace

CarriedComponents::CarriedComponents(const BoundSurface& bound) : bound_(bound) {
  const Triangles& t = bound.operators.triangles;
  const std::vector<int>& row_of = bound.order().row_of_vertex;
  std::vector<int> chosen;
  for (const Component& component : movable_components(bound.mesh, bound.region)) {
    if (component.held) continue;
    Carried carried;
    for (int v : component.vertices) carried.rows.push_back(row_of[v]);
    for (int j : component.triangles) {
      carried.triangles.push_back(static_cast<int>(chosen.size()));
      chosen.push_back(j);
      areas_.push_back(bound.operators.metric.areas[j]);
    }
    components_.push_back(std::move(carried));
  }
  triangles_.resize(static_cast<Index>(chosen.size()), 3);
  centroid_offsets_.resize(static_cast<Index>(chosen.size()), 3);
  for (size_t i = 0; i < chosen.size(); ++i) {
    for (int k = 0; k < 3; ++k) triangles_(Index(i), k) = row_of[t(chosen[i], k)];
    centroid_offsets_.row(Index(i)) = centroid(bound.rest, triangles_, Index(i)) -
                                      centroid(bound.rest_base, triangles_, Index(i));
  }
  rotation_blocks_ = rotation_blocks<double>(
      bound.base, t, chosen, stand_ins(bound.base, t, bounding_box_diagonal(bound.mesh.positions)),
      bound.order());
  rotations_ = Rows::Zero(kLanes * static_cast<Index>(rotation_blocks_.size()), 4);
}

void CarriedComponents::place(const Rows& base, Rows& offsets) {
  kernels().full.rotation_pass(static_cast<int>(rotation_blocks_.size()), rotation_blocks_.data(),
                               base.data(), rotations_.data());
  for (const Carried& component : components_) {
    MeanShift missing;
    for (int j : component.triangles) {
      const Eigen::Vector3d offset =
          quaternion(rotations_, j) * Eigen::Vector3d(centroid_offsets_.row(j).transpose());
      missing.add(areas_[j], centroid(base, triangles_, j) + offset.transpose() -
                                 centroid(bound_.rest, triangles_, j) -
                                 centroid(offsets, triangles_, j));
    }
    for (int r : component.rows) offsets.row(r).head<3>() += missing.mean();
  }
}

}  // namespace dd
