// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/intersections.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "mesh/aabb_tree.h"

namespace dd {

namespace {

double volume(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
              const Eigen::Vector3d& d) {
  return (b - a).cross(c - a).dot(d - a);
}

/// Whether the segment from vertex p to vertex q crosses the interior of triangle j.
bool crosses(const Mesh& mesh, int p, int q, int j) {
  const Eigen::Vector3d x = mesh.positions.row(p), y = mesh.positions.row(q);
  const auto corner = mesh.triangles.row(j);
  const Eigen::Vector3d a = mesh.positions.row(corner[0]), b = mesh.positions.row(corner[1]),
                        c = mesh.positions.row(corner[2]);
  // An end touches, and doesn't cross, if six times its tetrahedron's volume over the triangle is
  // below 1e-12 of the cube of the longest edge compared: the level of rounding.
  const double size = std::max({(b - a).norm(), (c - a).norm(), (y - x).norm(), (x - a).norm()});
  const double below = volume(a, b, c, x), above = volume(a, b, c, y);
  if (std::min(std::abs(below), std::abs(above)) < 1e-12 * size * size * size) return false;
  if ((below < 0) == (above < 0)) return false;
  const double u = volume(x, y, a, b), v = volume(x, y, b, c), w = volume(x, y, c, a);
  return (u > 0 && v > 0 && w > 0) || (u < 0 && v < 0 && w < 0);
}

}  // namespace

bool triangles_intersect(const Mesh& mesh, int first, int second) {
  const auto a = mesh.triangles.row(first), b = mesh.triangles.row(second);
  int shared = 0, of_first = -1, of_second = -1;
  for (int k = 0; k < 3; ++k)
    for (int l = 0; l < 3; ++l)
      if (a[k] == b[l]) {
        ++shared;
        of_first = k;
        of_second = l;
      }
  if (shared > 1) return false;
  for (int k = 0; k < 3; ++k) {
    // If a corner is shared, only the edge opposite to it can cross.
    if ((shared == 0 || k == of_first) && crosses(mesh, a[(k + 1) % 3], a[(k + 2) % 3], second))
      return true;
    if ((shared == 0 || k == of_second) && crosses(mesh, b[(k + 1) % 3], b[(k + 2) % 3], first))
      return true;
  }
  return false;
}

std::vector<std::pair<int, int>> intersecting_pairs(const Mesh& mesh) {
  std::vector<std::pair<int, int>> pairs;
  if (mesh.triangle_count() == 0) return pairs;
  const AabbTree tree(mesh);
  for (int j = 0; j < mesh.triangle_count(); ++j)
    tree.each_overlapping(j, [&](int other) {
      if (other > j && triangles_intersect(mesh, j, other)) pairs.emplace_back(j, other);
    });
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

}  // namespace dd
