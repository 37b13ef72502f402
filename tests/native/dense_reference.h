// SPDX-License-Identifier: GPL-3.0-or-later
// The method on dense matrices, by other formulas than the core's: angles instead of cotangents
// from dot products, (13)'s linear system for the gradients, (15) by a matrix inverse, the polar
// rotation by a singular value decomposition, elimination with pivoting. It has a source file of
// its own, because it takes longer to compile than the rest of a test.
#pragma once

#include <vector>

#include "meshes.h"

namespace dd::test {

struct DenseOperators {
  Eigen::MatrixXd L, M, G, D;
};

Eigen::Vector3d triangle_normal(const Positions& p, const Triangles& t, Index j);

DenseOperators dense_operators(const Positions& p, const Triangles& t);

/// Solves A x = 0 (+ right) on the free rows with the constrained rows of values given.
Positions dense_solve(const Eigen::MatrixXd& A, const Positions& values,
                      const std::vector<int>& roles, const Eigen::MatrixXd& right);

/// (15): deformation gradient of triangle j from q to q'.
Eigen::Matrix3d deformation_gradient(const Positions& q, const Positions& q_new, const Triangles& t,
                                     Index j);

Eigen::Matrix3d polar_rotation(const Eigen::Matrix3d& S);

struct DenseResult {
  Positions base, base_deformed, surface;
  Positions variational;  ///< VarMin without multiresolution: δ on S itself
};

/// handles: their matrices from rest to present. on_base: the bi-Laplacian of δq on B's geometry.
DenseResult dense_transfer(const Mesh& mesh, const std::vector<int>& roles,
                           const std::vector<Affine>& handles, bool on_base, bool rotation_only);

}  // namespace dd::test
