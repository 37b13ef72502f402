// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mesh/mesh.h"

namespace dd {

/// Quality measures of a deformed surface S' against S. Triangles with a free corner count.
struct Measures {
  int intersecting_pairs = 0;      ///< in S', of which at least one triangle counts
  int intersecting_triangles = 0;  ///< counting triangles in such pairs
  int new_intersecting_pairs = 0;  ///< those of the pairs that don't intersect in S
  double stretch = 0;       ///< area-weighted mean ‖S_j − R_j‖ (Frobenius), S_j (15) from S to S',
                            ///< R_j its rotation
  double normal_error = 0;  ///< mean angle, in degrees, between the normals of S' and those of S
                            ///< turned by the base's R_j; 0 without a base
  double area_ratio = 1;    ///< S' to S, all triangles
  double volume_ratio = 1;  ///< signed volumes, S' to S; meaningful for closed surfaces
};

/// deformed: n×3. free: n, non-zero for free vertices. base and deformed_base: n×3, or empty.
Measures measure(const Mesh& mesh, const Positions& deformed, const std::vector<char>& free,
                 const Positions& base = {}, const Positions& deformed_base = {});

/// Measures::stretch over all triangles.
double mean_stretch(const Mesh& mesh, const Positions& deformed);

}  // namespace dd
