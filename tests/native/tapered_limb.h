// SPDX-License-Identifier: GPL-3.0-or-later
// A limb whose cross-sections can be measured.
#pragma once

#include <algorithm>
#include <cmath>
#include <complex>
#include <vector>

#include "cases.h"
#include "support/rotations.h"

namespace dd::test {

/// A tapered limb of elliptic section along z, with relief as a fraction of its radius. Fixed
/// below, with a handle at its tip.
struct TaperedLimb {
  static constexpr double kLength = 4;
  int rings, sides;
  Mesh mesh;
  std::vector<int> roles;

  TaperedLimb(double bottom, double top, double flatness = 1, int density = 1, double relief = 0)
      : rings(60 * density),
        sides(28 * density),
        mesh(tube(rings, sides,
                  [=](double u, double v) {
                    const double radius = (bottom + (top - bottom) * u) *
                                          (1 + relief * std::sin(9 * v) * std::sin(60 * u));
                    return Eigen::RowVector3d(radius * std::cos(v), flatness * radius * std::sin(v),
                                              kLength * u);
                  })),
        roles(ends_held(mesh, 0.1, 0.9)) {}

  /// The same with a regular polygon for its circle, corners between vertices, flattened along y.
  TaperedLimb with_ridges(int corners, double flatness) const {
    TaperedLimb made = *this;
    const double side = 2 * kPi / corners;
    for (Index v = 0; v < made.mesh.positions.rows(); ++v) {
      auto p = made.mesh.positions.row(v);
      const double angle = std::atan2(p[1], p[0]) + 0.1;  // any, or corners would be vertices
      const double from_middle = angle - side * std::floor(angle / side) - side / 2;
      p.head<2>() *= std::cos(side / 2) / std::cos(from_middle);
      p[1] *= flatness;
    }
    return made;
  }

  /// The same with three bulges along it, by a fraction of the radius.
  TaperedLimb with_bulges(double height) const {
    TaperedLimb made = *this;
    for (Index v = 0; v < made.mesh.positions.rows(); ++v) {
      auto p = made.mesh.positions.row(v);
      p.head<2>() *= 1 + height * std::sin(20 * p[2] / kLength);
    }
    return made;
  }

  /// The same vertices with triangles that are symmetric about the plane x = 0: its quads are cut
  /// along the mirrored diagonals where x < 0.
  TaperedLimb symmetric() const {
    const auto mirrored = [&](int v) {
      return v >= rings * sides ? v : v - v % sides + (sides + sides / 2 - v % sides) % sides;
    };
    TaperedLimb made = *this;
    Index count = 0;
    for (Index j = 0; j < mesh.triangles.rows(); ++j) {
      const Eigen::RowVector3i t = mesh.triangles.row(j);
      const bool is_cap = t.maxCoeff() >= rings * sides;
      const double x = mesh.positions(t[0], 0) + mesh.positions(t[1], 0) + mesh.positions(t[2], 0);
      if (!is_cap && x < 0) continue;
      made.mesh.triangles.row(count++) = t;
      if (!is_cap)
        made.mesh.triangles.row(count++) << mirrored(t[0]), mirrored(t[2]), mirrored(t[1]);
    }
    return made;
  }

  double section(const Positions& p, int ring) const {
    const Positions points = p.middleRows(Index(ring) * sides, sides);
    const Eigen::RowVector3d centre = points.colwise().mean();
    Eigen::RowVector3d sum = Eigen::RowVector3d::Zero();
    for (int j = 0; j < sides; ++j)
      sum += (points.row(j) - centre).cross(points.row((j + 1) % sides) - centre);
    return sum.norm() / 2;
  }
  /// The least area of a ring over its area at rest.
  double least_section(const Positions& p) const {
    double least = 1e9;
    for (int ring = 0; ring < rings; ++ring)
      least = std::min(least, section(p, ring) / section(mesh.positions, ring));
    return least;
  }

  /// The largest difference of a ring's turn about z from an even one along the free part, over the
  /// whole turn.
  double unevenness(const Positions& p, double degrees) const {
    const auto is_free = [&](int ring) { return roles[size_t(ring) * size_t(sides)] == kFree; };
    int first = 0, last = rings - 1;  // the rings that hold the free ones
    while (!is_free(first + 1)) ++first;
    while (!is_free(last - 1)) --last;
    double farthest = 0, angle = 0;
    for (int ring = first; ring <= last; ++ring) {
      std::complex<double> turn = 0;
      for (Index v = Index(ring) * sides; v < Index(ring + 1) * sides; ++v)
        turn += std::complex<double>(p(v, 0), p(v, 1)) *
                std::conj(std::complex<double>(mesh.positions(v, 0), mesh.positions(v, 1)));
      angle += std::remainder(std::arg(turn) - angle, 2 * kPi);
      const double even = radians(degrees) * (ring - first) / (last - first);
      farthest = std::max(farthest, std::abs(angle - even));
    }
    return farthest / radians(degrees);
  }

  /// Motions of the tip: turned about the limb, led down without a turn, and bent.
  static Affine twist(double degrees) {
    return rotation_about(radians(degrees), {0, 0, 1}, {0, 0, 0}, {0, 0, 0});
  }
  static Affine led_down() {
    Affine motion = identity();
    motion.col(3) << 0, 0.7 * kLength, -0.7 * kLength;
    return motion;
  }
  static Affine bend(double degrees) { return test::bend(degrees, 0.19 * kLength, 0.5 * kLength); }
};

}  // namespace dd::test
