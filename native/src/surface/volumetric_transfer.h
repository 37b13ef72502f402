// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "surface/bound_surface.h"
#include "surface/gradients.h"
#include "surface/tets.h"

namespace dd {

/// Each triangle with a free corner as a tetrahedron, by a fourth point p₁ + e₁ × e₂ / √|e₁ × e₂|
/// (§3, after Sumner and Popović 2004), on its base: the first n vertices are the mesh's, fourth
/// points follow in the order of the triangles, which are returned too.
TetMesh with_fourth_points(const Mesh& mesh, const std::vector<int>& triangles);

/// D of (10).
enum class FourthPointWeights {
  volumes,  ///< the tetrahedra's: a volumetric Poisson system, §4
  ones      ///< (10) as it stands
};

/// The original deformation transfer (§3), which the paper's surface formulation replaces: n + m
/// unknowns in place of n, G̃ᵀ D G̃ p' = G̃ᵀ D S (10).
class VolumetricTransfer {
 public:
  /// Throws Error(mesh) naming a triangle without area: it has no tetrahedron.
  VolumetricTransfer(const BoundSurface& bound, FourthPointWeights weights);

  /// base: B', all rows in order. offsets: in those of the handles' vertices, out the free ones'.
  void update(const Rows& base, Rows& offsets, bool rotation_only);

  double bytes() const;

 private:
  const BoundSurface& bound_;
  std::vector<int> triangles_;
  GradientSources sources_;
  TetMesh tets_;
  TetPoisson poisson_;
};

}  // namespace dd
