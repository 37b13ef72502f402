// SPDX-License-Identifier: GPL-3.0-or-later
// Parts of faces: eyes that stand out of a skin, and lids that close.
#pragma once

#include <cmath>
#include <utility>

#include "meshes.h"
#include "support/rotations.h"

namespace dd::test {

inline Mesh ball(int levels, const Eigen::RowVector3d& centre, double radius) {
  Mesh mesh = sphere(levels);
  mesh.positions = (radius * mesh.positions).rowwise() + centre;
  return mesh;
}

/// The direction from the middle of a skin to its eye on the side -1 or 1.
inline Eigen::RowVector3d to_eye(int side) {
  return Eigen::RowVector3d(0.8, 0.45 * side, 0.4).normalized();
}

/// A skin and two eyes that stand out of it by the fraction `out` of their radius.
inline Mesh face(int levels, double radius, double out, double skin = 1) {
  Mesh mesh = ball(levels, {0, 0, 0}, skin);
  for (int side : {-1, 1})
    mesh = appended(mesh, ball(levels - 1, (skin + (out - 1) * radius) * to_eye(side), radius));
  return mesh;
}

/// A sheet with a slit along y = 1/2 that is open by `gap` in its middle, as an eye between lids.
struct Lids {
  static constexpr int kColumns = 41, kRows = 25;  // of either half; the last row is at the slit
  explicit Lids(double gap) {
    mesh = grid(kColumns, kRows, [](double, double) { return 0.0; });
    mesh = appended(mesh, mesh);
    for (int v = 0; v < 2 * kHalf; ++v) {
      const double x = mesh.positions(v, 0), to_slit = (v % kRows) / double(kRows - 1);
      const double y = to_slit * (0.5 - 0.5 * gap * std::sin(kPi * x));
      mesh.positions.row(v) << x, v < kHalf ? y : 1 - y, 0.02 * std::sin(3 * x);
    }
    for (Index k = 0; k < mesh.triangles.size(); ++k) {
      int& corner = mesh.triangles.data()[k];
      // The halves share their vertices at the slit's ends.
      const int column = corner % kHalf / kRows;
      if (corner >= kHalf && corner % kRows == kRows - 1 && (column == 0 || column == kColumns - 1))
        corner -= kHalf;
    }
    for (Index j = mesh.triangles.rows() / 2; j < mesh.triangles.rows(); ++j)
      std::swap(mesh.triangles(j, 1), mesh.triangles(j, 2));
  }
  /// The upper lid moved down by `by` in the middle of its edge, by less towards its other border.
  static Positions closed(const Positions& p, double by) {
    Positions result = p;
    for (int v = kHalf; v < 2 * kHalf; ++v)
      result(v, 1) -= by * std::sin(kPi * p(v, 0)) * (v % kRows) / (kRows - 1);
    return result;
  }
  /// Mean distance of the lids' edges in the middle third.
  static double gap(const Positions& p) {
    double sum = 0;
    int count = 0;
    for (int i = kColumns / 3; i < 2 * kColumns / 3; ++i, ++count)
      sum += (p.row(i * kRows + kRows - 1) - p.row(kHalf + i * kRows + kRows - 1)).norm();
    return sum / count;
  }
  static constexpr int kHalf = kColumns * kRows;
  Mesh mesh;
};

}  // namespace dd::test
