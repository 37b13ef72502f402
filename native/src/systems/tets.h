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

/// Gradient operator G (3), 3m×n, from (1): ∇φ_i is perpendicular to the face opposite to vertex i,
/// and its length is 1 / height.
SparseMatrix gradient(const TetMesh& mesh);

/// G̃ of (9), 3m×n, from (6) and (8): the rows a, b, c of V⁻¹ = (p₁ − p₄, p₂ − p₄, p₃ − p₄)⁻¹, and
/// −a − b − c. §4: it is G.
SparseMatrix deformation_operator(const TetMesh& mesh);

/// GᵀDG (4) on the free vertices of a tetrahedral mesh, factored once: gradient editing of solids.
class TetPoisson {
 public:
  /// roles: as for make_region(). weights: the diagonal of D, m values: volumes, or ones for (10)
  /// as it stands. operator_: G or G̃. Throws Error; progress of the factorization, from 0 to 1.
  TetPoisson(const TetMesh& mesh, const std::vector<int>& roles, int handle_count,
             SparseMatrix operator_, const Eigen::VectorXd& weights, const Progress& progress = {});

  const SparseMatrix& laplacian() const { return laplacian_; }  ///< GᵀDG, n×n
  const SparseMatrix& gradient_operator() const { return gradient_; }
  double factor_bytes() const { return factor_.bytes(); }

  /// Positions whose gradients are nearest to the given ones, with the positions of constrained
  /// vertices prescribed. gradients: 3m×3, S_jᵀ in rows 3j to 3j + 2 (I for the rest pose).
  Positions solve(const Positions& constrained, const RowMatrix& gradients) const;

  /// Harmonic weights: L w = 0, 1 on a handle's vertices and 0 on all other constrained ones, n×h.
  RowMatrix harmonic_weights() const;

 private:
  Positions rest_;
  Region region_;
  SparseMatrix gradient_, weighted_, laplacian_;  // G, GᵀD, GᵀDG
  SparseCholesky factor_;
};

/// Gradient editing (§2) of a solid: spreads the handles' rotations and stretches by harmonic
/// weights, as GradientEditing does, and solves for positions with these gradients. matrices: as
/// for Deformer.
Positions edit_by_gradients(const TetPoisson& poisson, const TetMesh& mesh,
                            const std::vector<int>& roles, int handle_count,
                            const double* matrices);

}  // namespace dd
