// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "support/types.h"

namespace dd {

/// An intrinsic triangulation of a surface: its vertices are the mesh's, and its edges run straight
/// over the faces. Only edge lengths are known, which is all that cotangents and areas need. Two
/// corners of a triangle may be one vertex.
struct IntrinsicTriangles {
  Triangles triangles;        ///< m×3
  CornerValues lengths;       ///< m×3, of the edge opposite to each corner
  std::vector<char> flipped;  ///< m: whether a flip changed this triangle
  int flips = 0;
};

/// The third corner of a triangle over the base from (0, 0) to (base, 0), from the lengths of its
/// edges to both ends.
struct TriangleApex {
  double foot, height;
};
TriangleApex triangle_apex(double base, double to_first, double to_last);

/// An edge is flipped if the cotangents of its opposite angles sum to less. Safety: in a regular
/// grid the sum is 0 for either diagonal, and the margin keeps the given one even where coordinates
/// are rounded to floats. With it, weights of L may have the wrong sign, up to 0.015.
constexpr double kObtuse = -0.03;

/// Flips edges until none is obtuse: the intrinsic Delaunay triangulation (Bobenko and Springborn
/// 2007), whose Laplacian has no negative weights and does not depend on how faces were cut into
/// triangles (up to the margin). The most obtuse edge is flipped first, so that the result does not
/// depend on the numbering. Edges without exactly two triangles, and edges of one triangle glued to
/// itself, are never flipped.
///
/// A triangle without area is given a height of 1e-9 of its longest edge.
IntrinsicTriangles intrinsic_delaunay(const Positions& positions, const Triangles& triangles,
                                      double obtuse = kObtuse);

}  // namespace dd
