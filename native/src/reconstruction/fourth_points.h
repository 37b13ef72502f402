// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mesh/mesh.h"
#include "reconstruction/gradient_source.h"
#include "systems/poisson_system.h"
#include "systems/tets.h"

namespace dd {

/// Extends each triangle to a tetrahedron by a fourth point p₁ + e₁ × e₂ / √|e₁ × e₂| (§3, after
/// Sumner and Popović 2004). The mesh's n vertices come first, then the fourth points in the order
/// of the triangles. Throws Error(mesh) naming a triangle without area, which has no tetrahedron.
TetMesh with_fourth_points(const Mesh& mesh, const std::vector<int>& triangles);

/// D of (10).
enum class FourthPointWeights {
  volumes,  ///< of the tetrahedra: a volumetric Poisson system, §4
  ones      ///< (10) as it stands
};

/// The original formulation of deformation transfer (§3), which the paper's surface formulation
/// replaces: n + m unknowns in place of n, G̃ᵀ D G̃ p' = G̃ᵀ D S (10).
class FourthPointSystem {
 public:
  /// triangles: those of the mesh that enter (10). Throws as with_fourth_points(), and
  /// Error(numeric); progress of the factorization, from 0 to 1.
  FourthPointSystem(const Mesh& mesh, const Region& region, std::vector<int> triangles,
                    FourthPointWeights weights, const Progress& progress = {});

  FourthPointWeights weights() const { return weights_; }
  int unknowns() const { return unknowns_; }
  double nonzeros() const { return static_cast<double>(poisson_.laplacian().nonZeros()); }

  /// offsets: displacements, rows in order; in: those of constrained vertices, out: those of free
  /// ones. The region's ground vertices stay at rest.
  void solve(const GradientSource& gradients, const RowOrder& order, Rows& offsets) const;

  double bytes() const;

 private:
  FourthPointWeights weights_;
  std::vector<int> triangles_;
  TetMesh tets_;
  TetPoisson poisson_;
  int unknowns_;
};

}  // namespace dd
