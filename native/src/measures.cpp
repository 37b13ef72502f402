// SPDX-License-Identifier: GPL-3.0-or-later
#include "measures.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "intersections.h"
#include "rotations.h"

namespace dd {

namespace {

/// The triangle's edges e1, e2 and unit normal; the normal is zero where there is no area.
Eigen::Matrix3d frame(const Positions& p, const Triangles& t, Index j, double& area) {
  Eigen::Matrix3d columns;
  columns.col(0) = p.row(t(j, 1)) - p.row(t(j, 0));
  columns.col(1) = p.row(t(j, 2)) - p.row(t(j, 0));
  const Eigen::Vector3d cross = columns.col(0).cross(columns.col(1));
  area = 0.5 * cross.norm();
  columns.col(2) = area > 0 ? Eigen::Vector3d(cross / (2 * area)) : Eigen::Vector3d::Zero();
  return columns;
}

/// Singular values of S_j but the third, which is 1: from the first fundamental forms.
Eigen::Vector2d stretches(const Eigen::Matrix3d& rest, const Eigen::Matrix3d& now) {
  const auto in_plane = [](const Eigen::Matrix3d& f) {
    const double length = f.col(0).norm();
    Eigen::Matrix2d edges;
    edges << length, f.col(0).dot(f.col(1)) / length, 0, f.col(0).cross(f.col(1)).norm() / length;
    return edges;
  };
  const Eigen::Matrix2d S = in_plane(now) * in_plane(rest).inverse();
  const double sum = Eigen::Vector2d(S(0, 0) + S(1, 1), S(1, 0) - S(0, 1)).norm();
  const double difference = Eigen::Vector2d(S(0, 0) - S(1, 1), S(1, 0) + S(0, 1)).norm();
  return {0.5 * (sum + difference), 0.5 * (sum - difference)};
}

double signed_volume(const Positions& p, const Triangles& t) {
  double sum = 0;
  for (Index j = 0; j < t.rows(); ++j) {
    const Eigen::Vector3d a = p.row(t(j, 0)), b = p.row(t(j, 1)), c = p.row(t(j, 2));
    sum += a.dot(b.cross(c)) / 6;
  }
  return sum;
}

}  // namespace

Measures measure(const Mesh& mesh, const Positions& deformed, const std::vector<char>& free,
                 const Positions& base, const Positions& deformed_base) {
  const Triangles& t = mesh.triangles;
  const auto counts = [&](Index j) { return free[t(j, 0)] || free[t(j, 1)] || free[t(j, 2)]; };
  Measures result;

  const auto before = intersecting_pairs(mesh);
  std::vector<char> caught(static_cast<size_t>(t.rows()), 0);
  for (const auto& pair : intersecting_pairs({deformed, t})) {
    if (!counts(pair.first) && !counts(pair.second)) continue;
    ++result.intersecting_pairs;
    result.new_intersecting_pairs += !std::binary_search(before.begin(), before.end(), pair);
    for (int j : {pair.first, pair.second})
      if (counts(j)) caught[j] = 1;
  }
  result.intersecting_triangles = static_cast<int>(std::count(caught.begin(), caught.end(), 1));

  double rest_area = 0, now_area = 0, weight = 0, angle = 0;
  int angle_count = 0;
  for (Index j = 0; j < t.rows(); ++j) {
    double area = 0, area_now = 0;
    const Eigen::Matrix3d rest = frame(mesh.positions, t, j, area);
    const Eigen::Matrix3d now = frame(deformed, t, j, area_now);
    rest_area += area;
    now_area += area_now;
    if (!counts(j) || area == 0 || area_now == 0) continue;
    result.stretch += area * (stretches(rest, now).array() - 1).matrix().norm();
    weight += area;
    if (base.size() == 0) continue;
    double base_area = 0, base_area_now = 0;
    const Eigen::Matrix3d from = frame(base, t, j, base_area);
    const Eigen::Matrix3d to = frame(deformed_base, t, j, base_area_now);
    if (base_area == 0 || base_area_now == 0) continue;
    const Eigen::Matrix3d S = to * from.inverse();
    const Eigen::Vector3d wanted = polar_rotation(S) * rest.col(2);
    angle += std::acos(std::clamp(now.col(2).dot(wanted), -1.0, 1.0));
    ++angle_count;
  }
  if (weight > 0) result.stretch /= weight;
  if (angle_count > 0) result.normal_error = angle / angle_count * 180 / std::acos(-1.0);
  if (rest_area > 0) result.area_ratio = now_area / rest_area;
  const double volume = signed_volume(mesh.positions, t);
  if (volume != 0) result.volume_ratio = signed_volume(deformed, t) / volume;
  return result;
}

}  // namespace dd
