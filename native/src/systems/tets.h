// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "solver/sparse_cholesky.h"
#include "systems/region.h"

namespace dd {

/// m×4 vertex numbers; any orientation.
using Tetrahedra = Eigen::Matrix<int, Eigen::Dynamic, 4, Eigen::RowMajor>;

/// A volumetric mesh (§4).
struct TetMesh {
  Positions positions;
  Tetrahedra tets;

  int vertex_count() const { return static_cast<int>(positions.rows()); }
  int tet_count() const { return static_cast<int>(tets.rows()); }
};

/// Throws Error(mesh) naming the vertex or tetrahedron: not finite, out of range, without volume.
void validate(const TetMesh& mesh);

/// m volumes, positive.
Eigen::VectorXd volumes(const TetMesh& mesh);

/// Gradient operator G (3), 3m×n, from (1): ∇φ_i is perpendicular to the face opposite to vertex i
/// and 1 / height long.
SparseMatrix gradient(const TetMesh& mesh);

/// G̃ of (9), 3m×n, from (6) and (8): the rows a, b, c of V⁻¹ = (p₁ − p₄, p₂ − p₄, p₃ − p₄)⁻¹, and
/// −a − b − c. §4: it is G.
SparseMatrix deformation_operator(const TetMesh& mesh);

/// GᵀDG (4) on the free vertices of a tetrahedral mesh, factored once: gradient editing of solids.
class TetPoisson {
 public:
  /// roles as for split_region(). weights: D, m values, the volumes; ones give (10) as it stands.
  /// operator_: G or G̃. Throws Error; progress of the factorization, from 0 to 1.
  TetPoisson(const TetMesh& mesh, const std::vector<int>& roles, int handle_count,
             SparseMatrix operator_, const Eigen::VectorXd& weights, const Progress& progress = {});

  const SparseMatrix& laplacian() const { return laplacian_; }  ///< GᵀDG, n×n
  const SparseMatrix& gradient_operator() const { return gradient_; }
  double factor_bytes() const { return factor_.bytes(); }

  /// Positions with the given ones of constrained vertices and, for the free ones, gradients
  /// nearest to those wanted: 3m×3, S_jᵀ in rows 3j to 3j + 2 (the gradient of the identity being
  /// I).
  Positions solve(const Positions& constrained, const RowMatrix& gradients) const;

  /// Harmonic weights: L w = 0, 1 on a handle's vertices and 0 on all other constrained ones, n×h.
  RowMatrix harmonic_weights() const;

 private:
  Positions rest_;
  Region region_;
  SparseMatrix gradient_, weighted_, laplacian_;  // G, GᵀD, GᵀDG
  SparseCholesky factor_;
};

/// Gradient editing (§2) of a solid: the handles' rotations and stretches, spread by harmonic
/// weights as in GradientEditing, and the positions that have these gradients. matrices: as for
/// Deformer.
Positions edit_by_gradients(const TetPoisson& poisson, const TetMesh& mesh,
                            const std::vector<int>& roles, int handle_count,
                            const double* matrices);

}  // namespace dd
