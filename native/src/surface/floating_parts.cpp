// SPDX-License-Identifier: GPL-3.0-or-later
#include "surface/floating_parts.h"

#include <Eigen/Geometry>

#include "surface/gradients.h"

namespace dd {

namespace {

Eigen::RowVector3d centre(const Rows& rows, const Triangles& t, Index j) {
  return (rows.row(t(j, 0)) + rows.row(t(j, 1)) + rows.row(t(j, 2))).head<3>() / 3;
}

}  // namespace

FloatingParts::FloatingParts(const BoundSurface& bound) : bound_(bound) {
  const Triangles& t = bound.mesh.triangles;
  const Components components = connected_components(bound.mesh);
  std::vector<int> part_of(static_cast<size_t>(components.count), -1);
  for (int v : bound.region.grounds) {
    part_of[components.of_vertex[v]] = static_cast<int>(parts_.size());
    parts_.emplace_back();
  }
  for (int r = 0; r < bound.order().free_count; ++r) {
    const int part = part_of[components.of_vertex[bound.order().vertex_of_row[r]]];
    if (part >= 0) parts_[part].rows.push_back(r);
  }
  std::vector<int> chosen;
  for (int j = 0; j < bound.mesh.triangle_count(); ++j) {
    const int part = part_of[components.of_vertex[t(j, 0)]];
    if (part < 0) continue;
    parts_[part].triangles.push_back(static_cast<int>(chosen.size()));
    chosen.push_back(j);
    areas_.push_back(bound.operators.metric.areas[j]);
  }
  triangles_.resize(static_cast<Index>(chosen.size()), 3);
  arms_.resize(static_cast<Index>(chosen.size()), 3);
  for (size_t i = 0; i < chosen.size(); ++i) {
    for (int k = 0; k < 3; ++k)
      triangles_(Index(i), k) = bound.order().row_of_vertex[t(chosen[i], k)];
    arms_.row(Index(i)) =
        centre(bound.rest, triangles_, Index(i)) - centre(bound.rest_base, triangles_, Index(i));
  }
  blocks_ = rotation_blocks<double>(
      bound.base, t, chosen,
      gradient_sources(bound.base, t, bounding_box_diagonal(bound.mesh.positions)), bound.order());
  rotations_ = Rows::Zero(kLanes * static_cast<Index>(blocks_.size()), 4);
}

void FloatingParts::settle(const Rows& base, Rows& offsets) {
  kernels().full.rotation_pass(static_cast<int>(blocks_.size()), blocks_.data(), base.data(),
                               rotations_.data());
  for (const Part& part : parts_) {
    Eigen::RowVector3d missing = Eigen::RowVector3d::Zero();
    double weight = 0;
    for (int j : part.triangles) {
      const Eigen::Quaterniond turn(Eigen::Vector4d(rotations_.row(j).transpose()));
      const Eigen::Vector3d arm = turn * Eigen::Vector3d(arms_.row(j).transpose());
      missing += areas_[j] * (centre(base, triangles_, j) + arm.transpose() -
                              centre(bound_.rest, triangles_, j) - centre(offsets, triangles_, j));
      weight += areas_[j];
    }
    missing /= weight;
    for (int r : part.rows) offsets.row(r).head<3>() += missing;
  }
}

}  // namespace dd
