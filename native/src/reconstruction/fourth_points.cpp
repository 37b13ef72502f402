// SPDX-License-Identifier: GPL-3.0-or-later
#include "reconstruction/fourth_points.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "support/error.h"

namespace dd {

namespace {

std::vector<int> with_free_fourth_points(const Region& region, size_t count) {
  std::vector<int> roles = region.role;
  for (int v : region.grounds) roles[v] = kFixed;
  roles.resize(roles.size() + count, kFree);
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
    // Safety: the direction of a smaller cross product is rounding.
    if (!(cross.norm() > 1e-9 * std::max(e1.squaredNorm(), e2.squaredNorm())))
      throw Error(Status::mesh, {Subject::triangle, triangles[static_cast<size_t>(i)]},
                  "has no area, so it has no fourth point", Remedy::dissolve_faces);
    result.positions.row(n + i) = (first + cross / std::sqrt(cross.norm())).transpose();
    result.tets.row(i) << corner[0], corner[1], corner[2], static_cast<int>(n + i);
  }
  return result;
}

FourthPointSystem::FourthPointSystem(const Mesh& mesh, const Region& region,
                                     std::vector<int> triangles, FourthPointWeights weights,
                                     const Progress& progress)
    : weights_(weights),
      triangles_(std::move(triangles)),
      tets_(with_fourth_points(mesh, triangles_)),
      poisson_(tets_, with_free_fourth_points(region, triangles_.size()), region.handle_count,
               deformation_operator(tets_),
               weights == FourthPointWeights::volumes ? volumes(tets_)
                                                      : Eigen::VectorXd::Ones(tets_.tet_count()),
               progress),
      unknowns_(region.free_count() - static_cast<int>(region.grounds.size()) +
                static_cast<int>(triangles_.size())) {}

void FourthPointSystem::solve(const GradientSource& source, const RowOrder& order,
                              Rows& offsets) const {
  Positions constrained = tets_.positions;
  for (int r = order.free_count; r < order.count(); ++r)
    constrained.row(order.vertex_of_row[r]) += offsets.row(r).head<3>();
  RowMatrix gradients(3 * tets_.tet_count(), 3);
  for (size_t i = 0; i < triangles_.size(); ++i)
    gradients.middleRows<3>(3 * Index(i)) = source.at(triangles_[i]).transpose();
  const Positions solved = poisson_.solve(constrained, gradients);
  for (int r = 0; r < order.free_count; ++r)
    offsets.row(r).head<3>() =
        solved.row(order.vertex_of_row[r]) - tets_.positions.row(order.vertex_of_row[r]);
}

double FourthPointSystem::bytes() const {
  const double entries = static_cast<double>(poisson_.laplacian().nonZeros() +
                                             2 * poisson_.gradient_operator().nonZeros());
  return poisson_.factor_bytes() + entries * (sizeof(double) + sizeof(int)) +
         static_cast<double>(tets_.positions.size() * Index(sizeof(double)) +
                             tets_.tets.size() * Index(sizeof(int)));
}

}  // namespace dd
