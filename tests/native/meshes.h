// SPDX-License-Identifier: GPL-3.0-or-later
// Meshes and roles that the tests share.
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <vector>

#include "mesh/mesh.h"
#include "systems/region.h"

namespace dd::test {

/// Grid over [0,1]×[0,1] with columns×rows vertices, height z = height(x, y).
template <class Height>
Mesh grid(int columns, int rows, Height height) {
  Mesh mesh;
  mesh.positions.resize(columns * rows, 3);
  for (int i = 0; i < columns; ++i)
    for (int j = 0; j < rows; ++j) {
      const double x = i / double(columns - 1), y = j / double(rows - 1);
      mesh.positions.row(i * rows + j) << x, y, height(x, y);
    }
  mesh.triangles.resize(2 * (columns - 1) * (rows - 1), 3);
  int t = 0;
  for (int i = 0; i + 1 < columns; ++i)
    for (int j = 0; j + 1 < rows; ++j) {
      const int a = i * rows + j, b = a + rows;
      mesh.triangles.row(t++) << a, b, b + 1;
      mesh.triangles.row(t++) << a, b + 1, a + 1;
    }
  return mesh;
}

/// Fig. 1: a plane with bumps × bumps round bumps.
inline Mesh bumpy_plane(int side, int bumps = 12) {
  return grid(side, side, [bumps](double x, double y) {
    const double spacing = 1.0 / bumps, radius = 0.45 * spacing;
    const double dx = x - (std::floor(x / spacing) + 0.5) * spacing;
    const double dy = y - (std::floor(y / spacing) + 0.5) * spacing;
    const double r2 = (dx * dx + dy * dy) / (radius * radius);
    return r2 < 1 ? radius * (1 - r2) * (1 - r2) : 0.0;
  });
}

/// Roles for a grid: columns left of first_free fixed, from first_handle on handle 0.
inline std::vector<int> strip_roles(int columns, int rows, int first_free, int first_handle) {
  std::vector<int> roles(static_cast<size_t>(columns * rows), kFree);
  for (int i = 0; i < columns; ++i)
    for (int j = 0; j < rows; ++j) {
      if (i < first_free) roles[i * rows + j] = kFixed;
      if (i >= first_handle) roles[i * rows + j] = 0;
    }
  return roles;
}

/// Sphere from an octahedron, split levels times: closed, irregular valences 4 and 6.
inline Mesh sphere(int levels) {
  Mesh mesh;
  mesh.positions.resize(6, 3);
  mesh.positions << 1, 0, 0, -1, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 1, 0, 0, -1;
  mesh.triangles.resize(8, 3);
  mesh.triangles << 0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4, 2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5;
  for (int level = 0; level < levels; ++level) {
    std::vector<Eigen::RowVector3d> points;
    for (Index v = 0; v < mesh.positions.rows(); ++v) points.push_back(mesh.positions.row(v));
    std::vector<std::vector<std::pair<int, int>>> halves(points.size());
    const auto middle = [&](int a, int b) {
      if (a > b) std::swap(a, b);
      for (const auto& [other, number] : halves[a])
        if (other == b) return number;
      points.push_back((points[a] + points[b]).normalized());
      halves[a].emplace_back(b, static_cast<int>(points.size()) - 1);
      return static_cast<int>(points.size()) - 1;
    };
    Triangles split(4 * mesh.triangles.rows(), 3);
    for (Index t = 0; t < mesh.triangles.rows(); ++t) {
      const int a = mesh.triangles(t, 0), b = mesh.triangles(t, 1), c = mesh.triangles(t, 2);
      const int ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
      split.row(4 * t) << a, ab, ca;
      split.row(4 * t + 1) << b, bc, ab;
      split.row(4 * t + 2) << c, ca, bc;
      split.row(4 * t + 3) << ab, bc, ca;
    }
    mesh.triangles = split;
    mesh.positions.resize(static_cast<Index>(points.size()), 3);
    for (size_t v = 0; v < points.size(); ++v)
      mesh.positions.row(static_cast<Index>(v)) = points[v];
  }
  return mesh;
}

/// A sphere with random relief along its normals.
inline Mesh rough_sphere(int levels, double relief, unsigned seed = 7) {
  Mesh mesh = sphere(levels);
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> height(1 - relief, 1 + relief);
  for (Index v = 0; v < mesh.positions.rows(); ++v) mesh.positions.row(v) *= height(random);
  return mesh;
}

/// Roles by height: below low fixed, above high handle 0, free between.
inline std::vector<int> roles_by_height(const Mesh& mesh, double low, double high) {
  std::vector<int> roles;
  for (Index v = 0; v < mesh.positions.rows(); ++v) {
    const double z = mesh.positions(v, 2);
    roles.push_back(z < low ? kFixed : z > high ? 0 : kFree);
  }
  return roles;
}

/// A row-major 3×4 affine matrix as the core takes it.
using Affine = Eigen::Matrix<double, 3, 4, Eigen::RowMajor>;

inline Affine identity() {
  Affine matrix = Affine::Zero();
  matrix.leftCols<3>().setIdentity();
  return matrix;
}

inline Affine rotation_about(double angle, const Eigen::Vector3d& axis,
                             const Eigen::Vector3d& pivot, const Eigen::Vector3d& shift) {
  Affine matrix;
  matrix.leftCols<3>() = Eigen::AngleAxisd(angle, axis.normalized()).toRotationMatrix();
  matrix.col(3) = pivot - matrix.leftCols<3>() * pivot + shift;
  return matrix;
}

inline Positions transformed(const Affine& matrix, const Positions& p) {
  return (p * matrix.leftCols<3>().transpose()).rowwise() + matrix.col(3).transpose();
}

inline Mesh appended(const Mesh& a, const Mesh& b) {
  Mesh both;
  both.positions.resize(a.positions.rows() + b.positions.rows(), 3);
  both.positions << a.positions, b.positions;
  both.triangles.resize(a.triangles.rows() + b.triangles.rows(), 3);
  both.triangles << a.triangles, (b.triangles.array() + a.vertex_count()).matrix();
  return both;
}

/// The same mesh with vertices shuffled and triangles in reverse order.
struct Renumbered {
  Mesh mesh;
  std::vector<int> roles, new_of_old;
};

inline Renumbered renumbered(const Mesh& mesh, const std::vector<int>& roles) {
  Renumbered result{mesh, roles, std::vector<int>(roles.size())};
  std::vector<int>& new_of_old = result.new_of_old;
  std::iota(new_of_old.begin(), new_of_old.end(), 0);
  std::mt19937 random(3);
  std::shuffle(new_of_old.begin(), new_of_old.end(), random);
  for (size_t v = 0; v < roles.size(); ++v) {
    result.mesh.positions.row(new_of_old[v]) = mesh.positions.row(Index(v));
    result.roles[new_of_old[v]] = roles[v];
  }
  for (Index k = 0; k < mesh.triangles.size(); ++k)
    result.mesh.triangles.data()[k] = new_of_old[mesh.triangles.data()[k]];
  result.mesh.triangles = result.mesh.triangles.colwise().reverse().eval();
  return result;
}

inline double largest_difference(const Positions& a, const Positions& b) {
  return (a - b).cwiseAbs().maxCoeff();
}

}  // namespace dd::test
