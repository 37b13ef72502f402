// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "mesh/mesh.h"

namespace dd {

/// n×9: a 3×3 deformation gradient for each vertex, row-major.
using VertexGradients = Eigen::Matrix<double, Eigen::Dynamic, 9, Eigen::RowMajor>;

/// For each vertex the mean of its triangles' deformation gradients (15), from S to S', weighted by
/// their areas on S. Leaves out triangles without area on S or S'; the identity if none remains.
/// deformed: S', n×3.
VertexGradients vertex_gradients(const Mesh& mesh, const Positions& deformed);

}  // namespace dd
