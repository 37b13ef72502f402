// SPDX-License-Identifier: GPL-3.0-or-later
#include "surface/volumetric_transfer.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <string>

#include "support/rotations.h"

namespace dd {

namespace {

std::vector<int> with_free_fourth_points(std::vector<int> roles, int count) {
  roles.resize(roles.size() + static_cast<size_t>(count), kFree);
  return roles;
}

}  // namespace

TetMesh with_fourth_points(const Mesh& mesh, const std::vector<int>& triangles) {
  const Index n = mesh.vertex_count(), count = static_cast<Index>(triangles.size());
  TetMesh result;
  result.positions.resize(n + count, 3);
  result.positions.topRows(n) = mesh.positions;
  result.tets.resize(count, 4);
  for (Index i = 0; i < count; ++i) {
    const auto corner = mesh.triangles.row(triangles[static_cast<size_t>(i)]);
    const Eigen::Vector3d first = mesh.positions.row(corner[0]);
    const Eigen::Vector3d e1 = mesh.positions.row(corner[1]).transpose() - first;
    const Eigen::Vector3d e2 = mesh.positions.row(corner[2]).transpose() - first;
    const Eigen::Vector3d cross = e1.cross(e2);
    if (!(cross.norm() > 1e-9 * std::max(e1.squaredNorm(), e2.squaredNorm())))
      throw Error(Status::mesh, "Triangle " + std::to_string(triangles[static_cast<size_t>(i)]) +
                                    " has no area, so it has no fourth point: use the surface "
                                    "formulation, or dissolve degenerate faces.");
    result.positions.row(n + i) = (first + cross / std::sqrt(cross.norm())).transpose();
    result.tets.row(i) << corner[0], corner[1], corner[2], static_cast<int>(n + i);
  }
  return result;
}

VolumetricTransfer::VolumetricTransfer(const BoundSurface& bound, FourthPointWeights weights)
    : bound_(bound),
      triangles_(bound.poisson->active().triangles),
      sources_(gradient_sources(bound.base, bound.mesh.triangles,
                                bounding_box_diagonal(bound.mesh.positions))),
      tets_(with_fourth_points(bound.mesh, triangles_)),
      poisson_(tets_,
               with_free_fourth_points(bound.region.role, static_cast<int>(triangles_.size())),
               bound.region.handle_count, deformation_operator(tets_),
               weights == FourthPointWeights::volumes ? volumes(tets_)
                                                      : Eigen::VectorXd::Ones(tets_.tet_count())) {}

void VolumetricTransfer::update(const Rows& base, Rows& offsets, bool rotation_only) {
  const RowOrder& order = bound_.order();
  Positions deformed_base(order.count(), 3), constrained = tets_.positions;
  for (int r = 0; r < order.count(); ++r) {
    deformed_base.row(order.vertex_of_row[r]) = base.row(r).head<3>();
    constrained.row(order.vertex_of_row[r]) += offsets.row(r).head<3>();
  }
  RowMatrix gradients(3 * tets_.tet_count(), 3);
  for (size_t i = 0; i < triangles_.size(); ++i) {
    const int source = sources_.of_triangle[triangles_[i]];
    Eigen::Matrix3d S = Eigen::Matrix3d::Identity();
    if (source >= 0)  // (15)
      S = edges_and_normal(deformed_base, bound_.mesh.triangles, source) *
          edges_and_normal(bound_.base, bound_.mesh.triangles, source).inverse();
    if (rotation_only) S = polar_rotation(S);
    gradients.middleRows<3>(3 * Index(i)) = S.transpose();
  }
  const Positions solved = poisson_.solve(constrained, gradients);
  for (int r = 0; r < order.free_count; ++r)
    offsets.row(r).head<3>() =
        solved.row(order.vertex_of_row[r]) - tets_.positions.row(order.vertex_of_row[r]);
}

double VolumetricTransfer::bytes() const {
  const double entries = static_cast<double>(poisson_.laplacian().nonZeros() +
                                             2 * poisson_.gradient_operator().nonZeros());
  return poisson_.factor_bytes() + entries * (sizeof(double) + sizeof(int)) +
         static_cast<double>(tets_.positions.size() * Index(sizeof(double)) +
                             tets_.tets.size() * Index(sizeof(int)));
}

}  // namespace dd
