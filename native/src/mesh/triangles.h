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

/// The edges e1, e2 from the triangle's first corner and its unit normal, as columns: those of
/// (15). The normal is zero where there is no area.
Eigen::Matrix3d edges_and_normal(const Positions& positions, const Triangles& triangles,
                                 Index triangle);
Eigen::Matrix3d edges_and_normal(const Eigen::Vector3d& first, const Eigen::Vector3d& second,
                                 const Eigen::Vector3d& third);

/// m areas.
Eigen::VectorXd triangle_areas(const Positions& positions, const Triangles& triangles);

/// m×3 unit normals, zero where there is no area.
Positions triangle_normals(const Positions& positions, const Triangles& triangles);

/// n×3: the triangles' normals around each vertex, twice their areas long, summed.
Positions summed_normals(const Positions& positions, const Triangles& triangles);

/// Of a closed surface, negative where normals point inwards; of an open one that of the cone to
/// the mean of its vertices.
double signed_volume(const Positions& positions, const Triangles& triangles);

}  // namespace dd
