// SPDX-License-Identifier: GPL-3.0-or-later
// The four deformations that surveys compare methods by (Botsch and Sorkine 2008), on meshes of our
// own: a bumpy plane lifted, a cylinder bent by 120°, a bar twisted by 135°, a branch of a cactus
// bent by 70°.
#pragma once

#include <cmath>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "meshes.h"

namespace dd::test {

struct Case {
  std::string name;
  Mesh mesh;
  std::vector<int> roles;
  Affine motion;  // of its one handle
};

/// A closed tube about the z axis from z = 0 to 1: rings × sides vertices and a cap's centre at
/// each end. place(u, v) gives the vertex at height u in [0, 1] and angle v in radians.
template <class Place>
Mesh tube(int rings, int sides, Place place) {
  Mesh mesh;
  mesh.positions.resize(rings * sides + 2, 3);
  for (int i = 0; i < rings; ++i)
    for (int j = 0; j < sides; ++j)
      mesh.positions.row(i * sides + j) =
          place(i / double(rings - 1), 2 * std::acos(-1.0) * j / sides);
  const int bottom = rings * sides, top = bottom + 1;
  for (int end : {0, 1})
    mesh.positions.row(end ? top : bottom) =
        mesh.positions.middleRows(end ? (rings - 1) * sides : 0, sides).colwise().mean();
  mesh.triangles.resize(2 * (rings - 1) * sides + 2 * sides, 3);
  int t = 0;
  for (int j = 0; j < sides; ++j) {
    const int next = (j + 1) % sides;
    for (int i = 0; i + 1 < rings; ++i) {
      const int a = i * sides, b = a + sides;
      mesh.triangles.row(t++) << a + j, a + next, b + next;
      mesh.triangles.row(t++) << a + j, b + next, b + j;
    }
    mesh.triangles.row(t++) << bottom, next, j;
    mesh.triangles.row(t++) << top, (rings - 1) * sides + j, (rings - 1) * sides + next;
  }
  return mesh;
}

/// Fixed below, one handle above: heights along z, as fractions of the mesh's height.
inline std::vector<int> ends_held(const Mesh& mesh, double fixed_below, double handle_above) {
  const double low = mesh.positions.col(2).minCoeff();
  const double height = mesh.positions.col(2).maxCoeff() - low;
  return roles_by_height(mesh, low + fixed_below * height, low + handle_above * height);
}

inline double radians(double degrees) { return degrees * std::acos(-1.0) / 180; }

/// Turns the upper end towards +x about the axis along y through (x, 0, z).
inline Affine bend(double degrees, double x, double z) {
  return rotation_about(radians(degrees), {0, 1, 0}, {x, 0, z}, {0, 0, 0});
}

inline Case lifted_plane(int side = 101) {
  const int held = side * 23 / 201;
  Affine lift = identity();
  lift(2, 3) = 0.2;
  return {"plane lifted", bumpy_plane(side), strip_roles(side, side, held, side - held), lift};
}

inline Case bent_cylinder(double degrees = 120) {
  Case made;
  made.name = "cylinder bent " + std::to_string(int(degrees));
  made.mesh = tube(81, 60, [](double u, double v) {
    return Eigen::RowVector3d(0.08 * std::cos(v), 0.08 * std::sin(v), 1.6 * u);
  });
  made.roles = ends_held(made.mesh, 0.1, 0.9);
  made.motion = bend(degrees, 0.3, 0.8);
  return made;
}

inline Case twisted_bar(double degrees = 135) {
  Case made;
  made.name = "bar twisted " + std::to_string(int(degrees));
  made.mesh = tube(61, 96, [](double u, double v) {
    // The angle runs along the square, so that the corners are vertices.
    const double s = 4 * v / std::acos(-1.0), side = std::floor(s / 2);  // 0 to 8
    const double along = s - 2 * side - 1;                               // -1 to 1
    const Eigen::Rotation2Dd turn(side * std::acos(-1.0) / 2);
    const Eigen::Vector2d corner = turn * Eigen::Vector2d(0.07, 0.07 * along);
    return Eigen::RowVector3d(corner.x(), corner.y(), 1.2 * u);
  });
  made.roles = ends_held(made.mesh, 0.1, 0.9);
  made.motion = rotation_about(radians(degrees), {0, 0, 1}, {0, 0, 0}, {0, 0, 0});
  return made;
}

/// A ribbed, tapering branch with rows of spines, closed by a round tip.
inline Case bent_cactus(double degrees = 70) {
  Case made;
  made.name = "cactus bent " + std::to_string(int(degrees));
  const double pi = std::acos(-1.0);
  made.mesh = tube(101, 72, [pi](double u, double v) {
    const double profile = 0.08 * (1 - 0.35 * u) * std::sqrt(1 - std::pow(u, 12) * 0.96);
    const double rib = std::pow(std::cos(4.5 * v), 2);
    const double spine = std::pow(std::max(0.0, std::cos(9 * v)), 3) *
                         std::pow(std::max(0.0, std::cos(2 * pi * 10 * u)), 3);
    const double radius = profile * (0.85 + 0.25 * rib + 0.3 * spine * (u > 0.03 && u < 0.97));
    return Eigen::RowVector3d(radius * std::cos(v), radius * std::sin(v), 1.5 * u);
  });
  made.roles = ends_held(made.mesh, 0.12, 0.85);
  made.motion = bend(degrees, 0.03, 0.7);
  return made;
}

/// Fig. 4: a cylinder about the z axis and its base, a cylinder of half the radius. A formula bends
/// the base towards +x over a short length.
struct ExplicitBend {
  Mesh mesh;
  Positions base, deformed_base;
};

inline Positions bent_explicitly(const Positions& p, double degrees, double bend_radius) {
  const double angle = radians(degrees), half = 0.5 * bend_radius * angle;
  Positions result = p;
  for (Index v = 0; v < p.rows(); ++v) {
    const double along = std::min(half, std::max(-half, p(v, 2))), rest = p(v, 2) - along;
    const double turn = along / bend_radius, arm = bend_radius - p(v, 0);
    result(v, 0) = bend_radius - arm * std::cos(turn) + std::sin(turn) * rest;
    result(v, 2) = arm * std::sin(turn) + std::cos(turn) * rest;
  }
  return result;
}

/// 9,900 triangles, radius 1, closed by caps. The bend's radius lies between that of the base, 0.5,
/// so that the bent base doesn't intersect itself, and that of the surface.
inline ExplicitBend cylinder_of_figure_4(double degrees, double bend_radius = 0.7) {
  ExplicitBend made;
  made.mesh = tube(90, 55, [](double u, double v) {
    return Eigen::RowVector3d(std::cos(v), std::sin(v), 9 * (u - 0.5));
  });
  made.base = made.mesh.positions;
  made.base.leftCols<2>() *= 0.5;
  made.deformed_base = bent_explicitly(made.base, degrees, bend_radius);
  return made;
}

/// A disc pulled out of a flat unit sheet with a fixed border; at radius 0 the middle vertex alone.
inline Case pulled_disc(int edges, double radius, double height = 0.3) {
  Case made;
  made.name = "disc pulled";
  made.mesh = grid(edges + 1, edges + 1, [](double, double) { return 0.0; });
  for (Index v = 0; v < made.mesh.positions.rows(); ++v) {
    const Eigen::RowVector3d p = made.mesh.positions.row(v);
    const bool border = p.x() == 0 || p.x() == 1 || p.y() == 0 || p.y() == 1;
    const bool disc = (p - Eigen::RowVector3d(0.5, 0.5, 0)).norm() <= radius + 1e-9;
    made.roles.push_back(disc ? 0 : border ? kFixed : kFree);
  }
  made.motion = identity();
  made.motion(2, 3) = height;
  return made;
}

/// Splits each triangle into four at the midpoints of its edges, which keeps the shape. A midpoint
/// has the role of its edge's ends where they agree, and is free elsewhere.
inline Case subdivided(Case one) {
  std::map<std::pair<int, int>, int> middles;
  std::vector<Eigen::RowVector3d> added;
  const int n = one.mesh.vertex_count(), m = one.mesh.triangle_count();
  const auto middle = [&](int a, int b) {
    const auto [found, is_new] =
        middles.try_emplace(std::minmax(a, b), n + static_cast<int>(added.size()));
    if (is_new) {
      added.push_back(0.5 * (one.mesh.positions.row(a) + one.mesh.positions.row(b)));
      one.roles.push_back(one.roles[a] == one.roles[b] ? one.roles[a] : kFree);
    }
    return found->second;
  };
  Triangles split(4 * m, 3);
  for (int j = 0; j < m; ++j) {
    const int a = one.mesh.triangles(j, 0), b = one.mesh.triangles(j, 1),
              c = one.mesh.triangles(j, 2);
    const int ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
    split.middleRows<4>(4 * j) << a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca;
  }
  one.mesh.triangles = split;
  one.mesh.positions.conservativeResize(n + Index(added.size()), 3);
  for (size_t i = 0; i < added.size(); ++i) one.mesh.positions.row(n + Index(i)) = added[i];
  return one;
}

inline std::vector<Case> survey_cases() {
  return {lifted_plane(), bent_cylinder(), twisted_bar(), bent_cactus()};
}

}  // namespace dd::test
