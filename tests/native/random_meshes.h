// SPDX-License-Identifier: GPL-3.0-or-later
// Meshes of all kinds made from a seed, for properties that hold for any mesh.
#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "cases.h"
#include "mesh/topology.h"
#include "triangulations.h"

namespace dd::test {

enum class Shape { rough_sphere, limb, holed_sheet, uneven_sheet, slivers, parts };
constexpr int kShapeCount = 6;

/// A relief of a few waves, which differ by seed.
inline auto random_relief(std::mt19937& random) {
  std::uniform_real_distribution<double> any(-1, 1);
  const double a = any(random), b = any(random), c = any(random);
  return [=](double x, double y) {
    return 0.08 * (std::sin(9 * x + 5 * a) * std::cos(7 * y * b) + std::sin(13 * c * (x + y)));
  };
}

inline Triangles kept_triangles(const Triangles& triangles, const std::vector<char>& keep) {
  Triangles result(std::count(keep.begin(), keep.end(), 1), 3);
  Index t = 0;
  for (size_t j = 0; j < keep.size(); ++j)
    if (keep[j]) result.row(t++) = triangles.row(Index(j));
  return result;
}

/// The mesh of the triangles that are kept, without other vertices.
inline Mesh kept(const Mesh& mesh, const std::vector<char>& keep) {
  Mesh result{{}, kept_triangles(mesh.triangles, keep)};
  std::vector<int> number(static_cast<size_t>(mesh.vertex_count()), -1), vertices;
  for (Index k = 0; k < result.triangles.size(); ++k) {
    int& corner = result.triangles.data()[k];
    int& found = number[corner];
    if (found < 0) {
      found = static_cast<int>(vertices.size());
      vertices.push_back(corner);
    }
    corner = found;
  }
  result.positions.resize(static_cast<Index>(vertices.size()), 3);
  for (size_t v = 0; v < vertices.size(); ++v)
    result.positions.row(static_cast<Index>(v)) = mesh.positions.row(vertices[v]);
  return result;
}

/// The mesh with three round holes.
inline Mesh holed(const Mesh& mesh, std::mt19937& random) {
  std::vector<char> keep(static_cast<size_t>(mesh.triangle_count()), 1);
  const double size =
      (mesh.positions.colwise().maxCoeff() - mesh.positions.colwise().minCoeff()).norm();
  for (int hole = 0; hole < 3; ++hole) {
    const Index middle = static_cast<Index>(random() % keep.size());
    const Eigen::RowVector3d at = mesh.positions.row(mesh.triangles(middle, 0));
    for (size_t j = 0; j < keep.size(); ++j) {
      const auto corner = mesh.triangles.row(static_cast<Index>(j));
      if ((mesh.positions.row(corner[0]) - at).norm() < 0.08 * size) keep[j] = 0;
    }
  }
  // Triangles at a vertex where borders meet are removed, too: such a border has no order.
  for (bool meet = true; meet;) {
    meet = false;
    const Mesh now = {mesh.positions, kept_triangles(mesh.triangles, keep)};
    const Borders borders(now.triangles, now.vertex_count());
    std::vector<int> leaving(static_cast<size_t>(now.vertex_count()), 0);
    for (Index k = 0; k < now.triangles.size(); ++k)
      leaving[now.triangles.data()[k]] += borders.half_edges[size_t(k)];
    for (size_t j = 0; j < keep.size(); ++j)
      for (int k = 0; k < 3; ++k)
        if (keep[j] && leaving[mesh.triangles(Index(j), k)] > 1) {
          keep[j] = 0;
          meet = true;
        }
  }
  // A mesh of few triangles stays as it is.
  return std::count(keep.begin(), keep.end(), 1) > 8 ? kept(mesh, keep) : mesh;
}

/// detail: 0 gives a few dozen vertices, 1 a few hundred, 2 a few thousand.
inline Mesh random_mesh(Shape shape, unsigned seed, int detail) {
  std::mt19937 random(seed);
  const auto below = [&](int count) { return static_cast<int>(random() % unsigned(count)); };
  const int side = (6 << detail) + below(5), other = (6 << detail) + below(5);
  switch (shape) {
    case Shape::rough_sphere:
      return rough_sphere(detail + 1, 0.02 * (1 + below(10)), seed);
    case Shape::limb: {
      const auto relief = random_relief(random);
      return tube(side, 6 + below(4) + 4 * detail, [&](double u, double v) {
        const double radius = 0.15 * (1 - 0.4 * u) + 0.1 * relief(u, std::cos(v));
        return Eigen::RowVector3d(radius * std::cos(v), radius * std::sin(v), 1.2 * u);
      });
    }
    case Shape::holed_sheet:
      return holed(grid(side, other, random_relief(random)), random);
    case Shape::uneven_sheet: {
      Mesh mesh = grid(side, other, random_relief(random));
      for (int c : {0, 1}) {
        const double power = 1 + 0.2 * below(6);
        mesh.positions.col(c) = mesh.positions.col(c).array().pow(power).eval();
      }
      return mesh;
    }
    case Shape::slivers:
      return with_slivers(grid(side, other, random_relief(random)), 0.5, seed);
    case Shape::parts: {
      Mesh mesh = random_mesh(Shape(below(kShapeCount - 1)), seed + 1, std::max(0, detail - 1));
      for (int more = 1 + below(2); more > 0; --more) {
        Mesh one = random_mesh(Shape(below(kShapeCount - 1)), seed + 2 + unsigned(more),
                               std::max(0, detail - 1));
        one.positions.col(1).array() += 2 * more;
        mesh = appended(mesh, one);
      }
      return mesh;
    }
  }
  return {};
}

/// In every loose part one end along a random direction is fixed and the other in handle 0. Each
/// further handle is the neighbourhood of a vertex; they end where they would leave too few free.
inline std::vector<int> random_roles(const Mesh& mesh, unsigned seed, int handle_count) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> any(-1, 1);
  // In statements of their own: compilers differ in which argument of a call comes first.
  const double x = any(random), y = any(random), z = any(random);
  const Eigen::Vector3d along(x + 0.05, 0.3 * y, z);
  const Eigen::VectorXd height = mesh.positions * along;
  const Components parts(mesh.triangles, mesh.vertex_count());
  const double infinity = std::numeric_limits<double>::infinity();
  std::vector<double> low(static_cast<size_t>(parts.count), infinity), high(low.size(), -infinity);
  for (int v = 0; v < mesh.vertex_count(); ++v) {
    const int part = parts.of_vertex[v];
    low[part] = std::min(low[part], height[v]);
    high[part] = std::max(high[part], height[v]);
  }
  const double fixed = 0.1 + 0.1 * any(random), held = 0.85 + 0.1 * any(random);
  std::vector<int> roles;
  for (int v = 0; v < mesh.vertex_count(); ++v) {
    const int part = parts.of_vertex[v];
    const double share = (height[v] - low[part]) / (high[part] - low[part]);
    roles.push_back(share <= fixed ? kFixed : share >= held ? 0 : kFree);
  }
  for (int h = 1; h < handle_count; ++h) {
    std::vector<int> taken = roles;
    size_t middle = random() % roles.size();
    for (size_t k = 0; k < roles.size() && taken[middle] != kFree; ++k)
      middle = (middle + 1) % roles.size();
    for (Index j = 0; j < mesh.triangles.rows(); ++j)
      if ((mesh.triangles.row(j).array() == int(middle)).any())
        for (int k = 0; k < 3; ++k)
          if (taken[mesh.triangles(j, k)] == kFree) taken[mesh.triangles(j, k)] = h;
    const auto held_count = std::count(taken.begin(), taken.end(), h);
    const auto free_count = std::count(taken.begin(), taken.end(), kFree);
    if (held_count == 0 || 2 * free_count < Index(roles.size()) / 2) break;
    roles = taken;
  }
  return roles;
}

}  // namespace dd::test
