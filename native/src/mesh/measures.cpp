// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/measures.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "mesh/intersections.h"
#include "mesh/triangles.h"
#include "support/rotations.h"

namespace dd {

namespace {

double area_of(const Eigen::Matrix3d& frame) {
  return 0.5 * frame.col(0).cross(frame.col(1)).norm();
}

/// The in-plane singular values of S_j (the third is 1), from the upper triangular Cholesky factors
/// of both first fundamental forms.
Eigen::Vector2d stretches(const Eigen::Matrix3d& rest, const Eigen::Matrix3d& now) {
  const auto in_plane = [](const Eigen::Matrix3d& f) {
    const double length = f.col(0).norm();
    Eigen::Matrix2d edges;
    edges << length, f.col(0).dot(f.col(1)) / length, 0, f.col(0).cross(f.col(1)).norm() / length;
    return edges;
  };
  // As I plus the difference from rest: a needle's inverse is so large that its rounding would
  // swamp the 1.
  const Eigen::Matrix2d from = in_plane(rest);
  const Eigen::Matrix2d S = Eigen::Matrix2d::Identity() + (in_plane(now) - from) * from.inverse();
  const double sum = Eigen::Vector2d(S(0, 0) + S(1, 1), S(1, 0) - S(0, 1)).norm();
  const double difference = Eigen::Vector2d(S(0, 0) - S(1, 1), S(1, 0) + S(0, 1)).norm();
  return {0.5 * (sum + difference), 0.5 * (sum - difference)};
}

}  // namespace

double mean_stretch(const Mesh& mesh, const Positions& deformed) {
  double sum = 0, weight = 0;
  for (Index j = 0; j < mesh.triangle_count(); ++j) {
    const Eigen::Matrix3d rest = edges_and_normal(mesh.positions, mesh.triangles, j);
    const Eigen::Matrix3d now = edges_and_normal(deformed, mesh.triangles, j);
    const double area = area_of(rest);
    if (area == 0 || area_of(now) == 0) continue;
    sum += area * (stretches(rest, now).array() - 1).matrix().norm();
    weight += area;
  }
  return weight > 0 ? sum / weight : 0;
}

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
    const Eigen::Matrix3d rest = edges_and_normal(mesh.positions, t, j);
    const Eigen::Matrix3d now = edges_and_normal(deformed, t, j);
    const double area = area_of(rest), area_now = area_of(now);
    rest_area += area;
    now_area += area_now;
    if (!counts(j) || area == 0 || area_now == 0) continue;
    result.stretch += area * (stretches(rest, now).array() - 1).matrix().norm();
    weight += area;
    if (base.size() == 0) continue;
    const Eigen::Matrix3d from = edges_and_normal(base, t, j);
    const Eigen::Matrix3d to = edges_and_normal(deformed_base, t, j);
    if (area_of(from) == 0 || area_of(to) == 0) continue;
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
