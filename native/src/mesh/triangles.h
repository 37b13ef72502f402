// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "support/types.h"

namespace dd {

inline Eigen::Vector3d triangle_centre(const Positions& positions, const Triangles& triangles,
                                       Index triangle) {
  return (positions.row(triangles(triangle, 0)) + positions.row(triangles(triangle, 1)) +
          positions.row(triangles(triangle, 2)))
             .transpose() /
         3;
}

/// Columns: the edges e1, e2 from the triangle's first corner and its unit normal, as in (15). The
/// normal is zero if the triangle has no area.
Eigen::Matrix3d edges_and_normal(const Positions& positions, const Triangles& triangles,
                                 Index triangle);
Eigen::Matrix3d edges_and_normal(const Eigen::Vector3d& first, const Eigen::Vector3d& second,
                                 const Eigen::Vector3d& third);

/// The m triangles' areas.
Eigen::VectorXd triangle_areas(const Positions& positions, const Triangles& triangles);

/// m×3: the triangles' unit normals, zero for triangles without area.
Positions triangle_normals(const Positions& positions, const Triangles& triangles);

/// n×3: for each vertex the sum of its triangles' normals weighted by twice their areas, not
/// normalized.
Positions summed_normals(const Positions& positions, const Triangles& triangles);

/// The volume that a closed surface encloses, negative if its normals point inwards. For an open
/// surface: the volume of the cone over it whose apex is the mean of the vertices.
double signed_volume(const Positions& positions, const Triangles& triangles);

}  // namespace dd
