// SPDX-License-Identifier: GPL-3.0-or-later
// A limb, poses of it and its handles, for the tests of posing by example.
#pragma once

#include "cases.h"
#include "deform.h"
#include "dense_reference.h"

namespace dd::test {

inline UpdateOptions posed() { return by(MethodKind::examples, false); }

inline UpdateOptions posed_by(const std::vector<double>& weights) {
  UpdateOptions options = posed();
  options.of_method.example_weights = weights;
  return options;
}

inline BindOptions with(const std::vector<Positions>& examples,
                        Precision precision = Precision::full) {
  BindOptions options;
  options.examples = examples;
  options.precision = precision;
  return options;
}

/// A limb along z from 0 to 1.6, its rings and their sides.
struct Limb {
  int rings, sides;
  Mesh mesh;
  explicit Limb(int ring_count = 33, int side_count = 12)
      : rings(ring_count), sides(side_count), mesh(tube(rings, sides, [](double u, double v) {
          return Eigen::RowVector3d(0.1 * std::cos(v), 0.1 * std::sin(v), 1.6 * u);
        })) {}

  Positions bent(double degrees, double joint, double turned_about_z = 0) const {
    Positions p = mesh.positions;
    const Affine turn = rotation_about(radians(turned_about_z), {0, 0, 1}, {0, 0, 0}, {0, 0, 0});
    const Affine back = rotation_about(-radians(turned_about_z), {0, 0, 1}, {0, 0, 0}, {0, 0, 0});
    p = transformed(back, p);
    const double length = 0.2, angle = radians(degrees), radius = length / angle;
    for (Index v = 0; v < p.rows(); ++v) {
      const double along = std::clamp(p(v, 2) - joint, 0.0, length);
      const double rest = std::max(0.0, p(v, 2) - joint - length);
      if (p(v, 2) <= joint) continue;
      const double t = along / radius, arm = radius - p(v, 0);
      p(v, 0) = radius - arm * std::cos(t) + std::sin(t) * rest;
      p(v, 2) = joint + arm * std::sin(t) + std::cos(t) * rest;
    }
    return transformed(turn, p);
  }

  /// Turned about z, by an angle that grows from 0 at the bottom.
  Positions twisted(double degrees) const {
    Positions p = mesh.positions;
    for (Index v = 0; v < p.rows(); ++v) {
      const Eigen::Rotation2Dd turn(radians(degrees) * p(v, 2) / 1.6);
      p.row(v).head<2>() = (turn * p.row(v).head<2>().transpose()).transpose();
    }
    return p;
  }

  /// Wider about the middle, along x.
  Positions swollen(const Positions& p) const {
    Positions result = p;
    for (Index v = 0; v < p.rows(); ++v)
      result(v, 0) *= 1 + std::exp(-40 * std::pow(mesh.positions(v, 2) - 0.8, 2));
    return result;
  }

  Eigen::RowVector3d centre(const Positions& p, int ring) const {
    return p.middleRows(ring * sides, sides).colwise().mean();
  }
};

/// The affine motion of a triangle from p to q, with (15).
inline Affine motion_of(const Mesh& mesh, const Positions& q, int triangle) {
  Affine motion;
  motion.leftCols<3>() = deformation_gradient(mesh.positions, q, mesh.triangles, triangle);
  const int v = mesh.triangles(triangle, 0);
  motion.col(3) = q.row(v).transpose() - motion.leftCols<3>() * mesh.positions.row(v).transpose();
  return motion;
}

/// The bottom fixed, and single triangles as handles.
struct Handled {
  std::vector<int> roles, triangles;
  Handled(const Limb& limb, const std::vector<int>& their_triangles)
      : roles(static_cast<size_t>(limb.mesh.vertex_count()), kFree), triangles(their_triangles) {
    for (int v = 0; v < limb.mesh.vertex_count(); ++v)
      if (limb.mesh.positions(v, 2) < 0.11) roles[v] = kFixed;
    for (size_t h = 0; h < triangles.size(); ++h)
      for (int k = 0; k < 3; ++k) roles[limb.mesh.triangles(triangles[h], k)] = int(h);
  }
  int count() const { return static_cast<int>(triangles.size()); }
  std::vector<Affine> at(const Mesh& mesh, const Positions& q) const {
    std::vector<Affine> motions;
    for (int triangle : triangles) motions.push_back(motion_of(mesh, q, triangle));
    return motions;
  }
};

/// tube() lists, for each side, two triangles between any two rings and then the two caps'.
inline int triangle_at(const Limb& limb, int ring, int side) {
  return side * 2 * limb.rings + 2 * ring;
}

struct ThreePoses {
  Limb limb;
  std::vector<Positions> examples = {limb.bent(80, 0.5), limb.swollen(limb.bent(100, 0.9, 90)),
                                     limb.bent(60, 1.1, 200)};
  Handled handles{limb,
                  {triangle_at(limb, 14, 2), triangle_at(limb, 22, 7), triangle_at(limb, 30, 4)}};
};

inline double box(const Mesh& mesh) { return bounding_box_diagonal(mesh.positions); }

}  // namespace dd::test
