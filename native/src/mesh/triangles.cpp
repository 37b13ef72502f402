// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/triangles.h"

#include <Eigen/Geometry>

namespace dd {

Eigen::Matrix3d edges_and_normal(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                                 const Eigen::Vector3d& c) {
  Eigen::Matrix3d columns;
  columns.col(0) = b - a;
  columns.col(1) = c - a;
  const Eigen::Vector3d cross = columns.col(0).cross(columns.col(1));
  const double length = cross.norm();
  columns.col(2) = length > 1e-300 ? Eigen::Vector3d(cross / length) : Eigen::Vector3d::Zero();
  return columns;
}

Eigen::Matrix3d edges_and_normal(const Positions& p, const Triangles& t, Index j) {
  return edges_and_normal(p.row(t(j, 0)).transpose(), p.row(t(j, 1)).transpose(),
                          p.row(t(j, 2)).transpose());
}

Eigen::VectorXd triangle_areas(const Positions& p, const Triangles& t) {
  Eigen::VectorXd areas(t.rows());
  for (Index j = 0; j < areas.size(); ++j) {
    const Eigen::Matrix3d e = edges_and_normal(p, t, j);
    areas[j] = 0.5 * e.col(0).cross(e.col(1)).norm();
  }
  return areas;
}

Positions triangle_normals(const Positions& p, const Triangles& t) {
  Positions normals(t.rows(), 3);
  for (Index j = 0; j < normals.rows(); ++j)
    normals.row(j) = edges_and_normal(p, t, j).col(2).transpose();
  return normals;
}

Positions summed_normals(const Positions& p, const Triangles& t) {
  Positions normals = Positions::Zero(p.rows(), 3);
  for (Index j = 0; j < t.rows(); ++j) {
    const Eigen::Matrix3d e = edges_and_normal(p, t, j);
    const Eigen::Vector3d cross = e.col(0).cross(e.col(1));
    for (int k = 0; k < 3; ++k) normals.row(t(j, k)) += cross.transpose();
  }
  return normals;
}

double signed_volume(const Positions& p, const Triangles& t) {
  if (p.rows() == 0) return 0;
  const Eigen::RowVector3d mean = p.colwise().mean();
  double sum = 0;
  for (Index j = 0; j < t.rows(); ++j) {
    const auto corner = [&](int k) -> Eigen::Vector3d { return p.row(t(j, k)) - mean; };
    sum += corner(0).dot(corner(1).cross(corner(2))) / 6;
  }
  return sum;
}

}  // namespace dd
