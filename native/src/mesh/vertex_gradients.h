// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "mesh/mesh.h"

namespace dd {

/// The deformation gradients of a surface at its vertices, 3×3 matrices row by row.
using VertexGradients = Eigen::Matrix<double, Eigen::Dynamic, 9, Eigen::RowMajor>;

/// Of each vertex the mean of the gradients (15) of the triangles around it, from S to S', weighted
/// by their areas on S. Triangles without an area on S or S' don't count; where none counts, it is
/// the identity. deformed: S', n×3.
VertexGradients vertex_gradients(const Mesh& mesh, const Positions& deformed);

}  // namespace dd
