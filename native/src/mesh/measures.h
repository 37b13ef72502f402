// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mesh/mesh.h"

namespace dd {

/// How a deformed surface S' compares with S. Triangles count that have a free corner.
struct Measures {
  int intersecting_pairs = 0;      ///< of S', at least one of the two counting
  int intersecting_triangles = 0;  ///< that count and are in such a pair
  int new_intersecting_pairs = 0;  ///< of those, the pairs that don't intersect in S
  double stretch = 0;       ///< area-weighted mean ‖S_j − R_j‖ (Frobenius), S_j (15) from S to S',
                            ///< R_j its rotation
  double normal_error = 0;  ///< mean angle, in degrees, between the normals of S' and those of S
                            ///< turned by the base's R_j; 0 without a base
  double area_ratio = 1;    ///< of all triangles
  double volume_ratio = 1;  ///< of the signed volumes; of use for closed surfaces
};

/// deformed: n×3; free: n, whether a vertex is. base and deformed_base: n×3, or empty.
Measures measure(const Mesh& mesh, const Positions& deformed, const std::vector<char>& free,
                 const Positions& base = {}, const Positions& deformed_base = {});

/// The stretch alone, of all triangles.
double mean_stretch(const Mesh& mesh, const Positions& deformed);

}  // namespace dd
