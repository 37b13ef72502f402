// SPDX-License-Identifier: GPL-3.0-or-later
// Bodies with limbs, their poses, and errors of a fit.
#pragma once

#include <algorithm>
#include <cmath>

#include "mesh/unit_box.h"
#include "meshes.h"
#include "support/rotations.h"

namespace dd::test {

inline double beast_radius(const Eigen::RowVector3d& direction) {
  const Eigen::RowVector3d limbs[5] = {
      {1, 0.1, 0.3}, {-0.8, 0.5, -0.2}, {0.1, -1, 0.4}, {-0.3, 0.2, 1}, {0.4, 0.7, -0.7}};
  const double lengths[5] = {2.4, 1.6, 1.1, 0.8, 0.6};
  double radius = 0.7;
  for (int k = 0; k < 5; ++k)
    radius += lengths[k] * std::exp(-12 * (direction - limbs[k].normalized()).squaredNorm());
  return radius;
}

/// A body of a sphere's topology with five limbs of different lengths and no symmetry.
inline Mesh beast(int levels) {
  Mesh mesh = sphere(levels);
  for (Index v = 0; v < mesh.positions.rows(); ++v)
    mesh.positions.row(v) *= beast_radius(mesh.positions.row(v));
  return mesh;
}

constexpr double kCavity = 0.45;  ///< radius of hollow()'s cavity

/// The beast with a narrow opening and a cavity behind it.
inline Mesh hollow(int levels) {
  Mesh mesh = sphere(levels);
  const Eigen::Vector3d opening = Eigen::Vector3d(-0.5, -0.5, -0.7).normalized();
  // Angles from the opening: the sphere's cap that becomes the cavity, and the opening's edge.
  constexpr double kInside = 1.3, kRim = 0.2;
  for (Index v = 0; v < mesh.positions.rows(); ++v) {
    const Eigen::Vector3d direction = mesh.positions.row(v).transpose();
    const double angle = std::acos(std::clamp(direction.dot(opening), -1.0, 1.0));
    const Eigen::Vector3d side = (direction - direction.dot(opening) * opening).normalized();
    const bool inside = angle < kInside;
    const double moved = inside ? kPi + (kRim - kPi) * angle / kInside
                                : kPi + (kRim - kPi) * (kPi - angle) / (kPi - kInside);
    const Eigen::Vector3d there = std::cos(moved) * opening + std::sin(moved) * side;
    const double wall = beast_radius(there.transpose());
    const double depth = std::clamp((kInside - angle) / 0.1, 0.0, 1.0);
    mesh.positions.row(v) = (wall + depth * (kCavity - wall)) * there.transpose();
  }
  return mesh;
}

/// The beast with two more long legs beside each other.
inline Mesh forked(int levels) {
  Mesh mesh = beast(levels);
  for (Index v = 0; v < mesh.positions.rows(); ++v) {
    auto p = mesh.positions.row(v);
    const Eigen::RowVector3d direction = p.normalized();
    for (double side : {-1, 1})
      p += 2.5 * direction *
           std::exp(
               -20 *
               (direction - Eigen::RowVector3d(-0.4, 0.35 * side, -1).normalized()).squaredNorm());
  }
  return mesh;
}

/// The two legs of forked() turned aside, in y, by 75°.
inline Positions aside(const Positions& p) {
  Positions result = p;
  for (Index v = 0; v < p.rows(); ++v) {
    const double share = std::clamp(-p(v, 2) - 0.6, 0.0, 0.8) / 0.8;
    const double turn = 1.3 * share * share * (3 - 2 * share);
    const double y = p(v, 1), z = p(v, 2) + 0.8;
    result(v, 1) = std::cos(turn) * y - std::sin(turn) * z;
    result(v, 2) = std::sin(turn) * y + std::cos(turn) * z - 0.8;
  }
  return result;
}

/// The longest limb of a beast(), along x, bent upwards.
inline Positions raised(const Positions& p, double curvature) {
  Positions result = p;
  for (Index v = 0; v < p.rows(); ++v) {
    const double along = std::max(0.0, p(v, 0) - 0.8), radius = 1 / curvature - p(v, 2);
    if (along == 0) continue;
    result(v, 0) = 0.8 + radius * std::sin(curvature * along);
    result(v, 2) = 1 / curvature - radius * std::cos(curvature * along);
  }
  return result;
}

inline Positions turned(const Positions& p, double angle) {
  return transformed(rotation_about(angle, {1, 2, 3}, {0, 0, 0}, {5, -2, 1}), p);
}

/// Mean distance of the fitted vertices from their true places, as a fraction of the box.
inline double mean_error(const Positions& fitted, const Positions& truth) {
  return (fitted - truth).rowwise().norm().mean() / bounding_box_diagonal(truth);
}

/// The mean over the vertices that `has` accepts.
template <class Has>
inline double mean_error(const Positions& fitted, const Positions& truth, const Has& has) {
  double sum = 0;
  int count = 0;
  for (Index v = 0; v < truth.rows(); ++v) {
    if (!has(v)) continue;
    sum += (fitted.row(v) - truth.row(v)).norm();
    ++count;
  }
  return sum / count / bounding_box_diagonal(truth);
}

inline double largest_error(const Positions& fitted, const Positions& truth) {
  return (fitted - truth).rowwise().norm().maxCoeff() / bounding_box_diagonal(truth);
}

/// Directions of a quadruped's legs, head and tail.
constexpr double kLimbs[6][3] = {{0.7, 0.35, -1},   {0.7, -0.35, -1}, {-0.7, 0.35, -1},
                                 {-0.7, -0.35, -1}, {1, 0, 0.7},      {-1, 0, 0.5}};

/// A body on four legs with a head and a tail, symmetric from left to right.
inline Mesh quadruped(int levels, double legs = 2, double neck = 1.6) {
  const double lengths[6] = {legs, legs, legs, legs, neck, 1.2};
  Mesh mesh = sphere(levels);
  for (Index v = 0; v < mesh.positions.rows(); ++v) {
    const Eigen::RowVector3d direction = mesh.positions.row(v);
    double radius = 0.7;
    for (int k = 0; k < 6; ++k) {
      const Eigen::RowVector3d way(kLimbs[k][0], kLimbs[k][1], kLimbs[k][2]);
      radius += lengths[k] * std::exp(-20 * (direction - way.normalized()).squaredNorm());
    }
    mesh.positions.row(v) *= radius;
    mesh.positions(v, 0) *= 1.3;
  }
  return mesh;
}

/// A quadruped() whose legs are swung about y, neighbouring legs in opposite directions.
inline Positions striding(const Positions& p, double angle) {
  Positions result = p;
  for (Index v = 0; v < p.rows(); ++v) {
    const double share = std::clamp(-p(v, 2) - 0.5, 0.0, 0.6) / 0.6;
    const double fore = p(v, 0) > 0 ? 1 : -1, left = p(v, 1) > 0 ? 1 : -1;
    const double turn = fore * left * angle * share * share * (3 - 2 * share);
    const double x = p(v, 0) - fore * 0.8, z = p(v, 2) + 0.5;
    result(v, 0) = std::cos(turn) * x + std::sin(turn) * z + fore * 0.8;
    result(v, 2) = -std::sin(turn) * x + std::cos(turn) * z - 0.5;
  }
  return result;
}

}  // namespace dd::test
