// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/vertex_gradients.h"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "mesh/triangles.h"

namespace dd {

namespace {

using RowMajor3d = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

// Least ratio of twice the area to the square of the longer of e1, e2. Safety: the inverse in (15)
// of a flatter triangle is rounding.
constexpr double kMinAreaRatio = 1e-6;

double double_area(const Eigen::Matrix3d& edges) {
  const double area = edges.col(0).cross(edges.col(1)).norm();
  const double longest = edges.leftCols<2>().colwise().squaredNorm().maxCoeff();
  return area > kMinAreaRatio * longest ? area : 0;
}

}  // namespace

VertexGradients vertex_gradients(const Mesh& mesh, const Positions& deformed) {
  const Triangles& t = mesh.triangles;
  VertexGradients sums = VertexGradients::Zero(mesh.vertex_count(), 9);
  Eigen::VectorXd weights = Eigen::VectorXd::Zero(mesh.vertex_count());
  for (Index j = 0; j < t.rows(); ++j) {
    const Eigen::Matrix3d rest = edges_and_normal(mesh.positions, t, j);
    const Eigen::Matrix3d now = edges_and_normal(deformed, t, j);
    const double area = double_area(rest);
    if (!(area > 0 && double_area(now) > 0)) continue;
    const RowMajor3d gradient = now * rest.inverse();
    for (int k = 0; k < 3; ++k) {
      sums.row(t(j, k)) += area * Eigen::Map<const Eigen::Matrix<double, 1, 9>>(gradient.data());
      weights[t(j, k)] += area;
    }
  }
  const RowMajor3d identity = RowMajor3d::Identity();
  for (Index v = 0; v < sums.rows(); ++v) {
    if (weights[v] > 0)
      sums.row(v) /= weights[v];
    else
      sums.row(v) = Eigen::Map<const Eigen::Matrix<double, 1, 9>>(identity.data());
  }
  return sums;
}

}  // namespace dd
