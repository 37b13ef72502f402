// SPDX-License-Identifier: GPL-3.0-or-later
#include "reconstruction/fold_limits.h"

#include <cmath>

namespace dd {

namespace {

// The fraction of a triangle's area that arms may leave of it. Tuned: of 36 poses of public meshes,
// most of which should not bend as limbs, 25 fold more than a hollow skin without a limit, 5 with
// 0.3, 2 with 0.6; with 0.8 limbs that are led aside lose 4% of their sections.
constexpr double kLeastArea = 0.6;

/// Quaternions at a distance d are rotations at most 2 d apart, in the operator norm, and one of
/// three rotations is at most 2/3 of their largest distance from their mean. So edges p, q change by
/// at most D = 8/3 d |r|, and the area by (D (|p| + |q|) + D²) |p × q|⁻¹. positions, arms: of the
/// corners, a column each.
double harmless_distance(const Eigen::Matrix3d& positions, const Eigen::Matrix3d& arms) {
  const Eigen::Vector3d p = positions.col(1) - positions.col(0),
                        q = positions.col(2) - positions.col(0);
  const double sum = p.norm() + q.norm(), area = p.cross(q).norm();
  const double change =
      0.5 * (std::sqrt(sum * sum + 4 * (1 - kLeastArea) * area) - sum);  // D that takes all of it
  return change / (8.0 / 3 * arms.colwise().norm().maxCoeff());
}

}  // namespace

void FoldLimits::set(const CrossSectionArms& arms) {
  triangles_.clear();
  begin_.clear();
  if (arms.empty()) return;
  const PoissonSystem& poisson = *surface_.poisson;
  const ActiveTriangles& active = poisson.active();
  for (int section = 0; section < active.sections(); ++section) {
    begin_.push_back(static_cast<int>(triangles_.size()));
    for (int i = active.begin[size_t(section)]; i < active.begin[size_t(section) + 1]; ++i) {
      Triangle triangle;
      triangle.number = active.triangles[size_t(i)];
      Eigen::Matrix3d positions, of_corners;
      for (int k = 0; k < 3; ++k) {
        const int v = surface_.operators.triangles(triangle.number, k);
        triangle.corner[k] = poisson.active_index_of_vertex(v);
        triangle.target[k] = poisson.right_hand_side_row(section, v);
        positions.col(k) = surface_.mesh.positions.row(v).transpose();
        of_corners.col(k) = arms.before(triangle.corner[k]);
      }
      if (of_corners.isZero(0)) continue;
      const double distance = harmless_distance(positions, of_corners);
      triangle.harmless = distance * distance;
      triangles_.push_back(triangle);
    }
  }
  begin_.push_back(static_cast<int>(triangles_.size()));
}

double FoldLimits::factor_of(const Eigen::Matrix3d& mean, const Eigen::Matrix3d& p,
                             const Eigen::Matrix3d& beyond) {
  const Eigen::Vector3d along = mean * (p.col(1) - p.col(0)), across = mean * (p.col(2) - p.col(0)),
                        normal = along.cross(across);
  const double area = normal.squaredNorm();
  if (!(area > 0)) return 1;
  const double left = (along + beyond.col(1) - beyond.col(0))
                          .cross(across + beyond.col(2) - beyond.col(0))
                          .dot(normal) /
                      area;
  return left < kLeastArea ? (1 - kLeastArea) / (1 - left) : 1.0;
}

}  // namespace dd
