// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "support/types.h"

namespace dd {

/// The same surface in other triangles: each has three vertices of the mesh, and its edges run
/// straight over the faces, as over a sheet of paper that is folded along the old edges. Lengths
/// are all that is known of it, and all that cotangents and areas need. Corners may coincide.
struct IntrinsicTriangles {
  Triangles triangles;      ///< m×3
  CornerValues lengths;     ///< m×3, of the edge opposite to each corner
  std::vector<char> moved;  ///< m: whether it is another than the mesh has there
  int flips = 0;
};

/// Where the third corner of a triangle stands over a base from (0, 0) to (length, 0), by the
/// lengths of its edges to both ends of that.
struct TriangleApex {
  double foot, height;
};
TriangleApex triangle_apex(double base, double to_first, double to_last);

/// An edge whose cotangents sum to less is flipped. A regular grid is free to have its diagonals as
/// it has them, and so is one that is rounded to floats.
constexpr double kObtuse = -0.03;

/// Flips edges until none is obtuse: the intrinsic Delaunay triangulation (Bobenko and Springborn
/// 2007), whose Laplacian has no negative weights and doesn't depend on how faces were cut into
/// triangles. The most obtuse edge goes first, so that the numbering has no say. An edge with
/// another number of triangles than two stays, and so does a loop.
///
/// A triangle without area is taken as one of a very small height.
IntrinsicTriangles intrinsic_delaunay(const Positions& positions, const Triangles& triangles,
                                      double obtuse = kObtuse);

}  // namespace dd
