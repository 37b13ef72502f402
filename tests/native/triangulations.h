// SPDX-License-Identifier: GPL-3.0-or-later
// One shape in other triangles, and a shape of three sheets.
#pragma once

#include <Eigen/Geometry>
#include <map>
#include <utility>
#include <vector>

#include "meshes.h"

namespace dd::test {

/// The same shape and vertices with slivers for triangles. In three passes, edges between triangles
/// that are coplanar up to tolerance, in radians, are flipped to obtuse ones where possible.
inline Mesh with_slivers(Mesh mesh, double tolerance = 1e-6, unsigned seed = 1) {
  const auto place = [&](int v) -> Eigen::Vector3d { return mesh.positions.row(v).transpose(); };
  const auto normal = [&](int a, int b, int c) -> Eigen::Vector3d {
    return (place(b) - place(a)).cross(place(c) - place(a));
  };
  const auto angle = [](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
    return std::atan2(a.cross(b).norm(), a.dot(b));
  };
  const auto cotangent = [&](int apex, int a, int b) {
    const Eigen::Vector3d x = place(a) - place(apex), y = place(b) - place(apex);
    return x.dot(y) / x.cross(y).norm();
  };
  std::mt19937 random(seed);
  for (int pass = 0; pass < 3; ++pass) {
    std::map<std::pair<int, int>, std::vector<int>> sides;
    for (int side = 0; side < mesh.triangles.size(); ++side)
      sides[std::minmax(mesh.triangles(side / 3, side % 3),
                        mesh.triangles(side / 3, (side + 1) % 3))]
          .push_back(side);
    std::vector<std::pair<int, int>> edges;
    for (const auto& [edge, both] : sides) edges.push_back(edge);
    std::shuffle(edges.begin(), edges.end(), random);
    std::vector<char> used(static_cast<size_t>(mesh.triangle_count()), 0);
    for (const auto& edge : edges) {
      const std::vector<int>& both = sides[edge];
      if (both.size() != 2 || used[both[0] / 3] || used[both[1] / 3]) continue;
      const auto first = mesh.triangles.row(both[0] / 3), second = mesh.triangles.row(both[1] / 3);
      const int a = first[both[0] % 3], b = first[(both[0] + 1) % 3];
      const int c = first[(both[0] + 2) % 3], d = second[(both[1] + 2) % 3];
      if (sides.count(std::minmax(c, d))) continue;
      const Eigen::Vector3d old = normal(a, b, c);
      const double least = 1e-4 * (place(c) - place(d)).squaredNorm();
      const Eigen::Vector3d made[] = {normal(c, d, b), normal(d, c, a)};
      bool flat = angle(old, normal(b, a, d)) <= tolerance;
      for (const Eigen::Vector3d& n : made)
        flat = flat && n.norm() > least && angle(old, n) <= tolerance;
      if (!flat || cotangent(a, c, d) + cotangent(b, c, d) > -0.05) continue;
      mesh.triangles.row(both[0] / 3) << c, d, b;
      mesh.triangles.row(both[1] / 3) << d, c, a;
      used[both[0] / 3] = used[both[1] / 3] = 1;
      sides[std::minmax(c, d)];
    }
  }
  return mesh;
}

/// Three sheets that meet in one line, whose edges have three triangles each: a T.
struct Junction {
  Mesh mesh;
  std::vector<int> roles;  // the far border of the stem is handle 0, those of the bar are fixed
};

inline Junction junction(int side = 15) {
  Junction made;
  made.mesh =
      grid(side, side, [](double x, double y) { return 0.03 * std::sin(9 * x) * std::cos(7 * y); });
  const int middle = side / 2, n = side * side;
  made.roles.assign(static_cast<size_t>(n + side * middle), kFree);
  std::vector<Eigen::RowVector3d> added;
  std::vector<Eigen::RowVector3i> faces;
  const auto on_stem = [&](int level, int j) {
    return level == 0 ? middle * side + j : n + (level - 1) * side + j;
  };
  for (int level = 1; level <= middle; ++level)
    for (int j = 0; j < side; ++j) {
      const double z = level / (side - 1.0);
      added.push_back(made.mesh.positions.row(on_stem(0, j)) +
                      Eigen::RowVector3d(0.02 * std::sin(8 * z + j), 0, z));
      if (level == middle) made.roles[size_t(on_stem(level, j))] = 0;
      if (j == 0) continue;
      const int a = on_stem(level - 1, j - 1), b = on_stem(level - 1, j);
      const int c = on_stem(level, j), d = on_stem(level, j - 1);
      faces.emplace_back(a, b, c);
      faces.emplace_back(a, c, d);
    }
  for (int j = 0; j < side; ++j) made.roles[j] = made.roles[(side - 1) * side + j] = kFixed;
  const Index m = made.mesh.triangles.rows();
  made.mesh.positions.conservativeResize(n + Index(added.size()), 3);
  for (size_t i = 0; i < added.size(); ++i) made.mesh.positions.row(n + Index(i)) = added[i];
  made.mesh.triangles.conservativeResize(m + Index(faces.size()), 3);
  for (size_t i = 0; i < faces.size(); ++i) made.mesh.triangles.row(m + Index(i)) = faces[i];
  return made;
}

}  // namespace dd::test
