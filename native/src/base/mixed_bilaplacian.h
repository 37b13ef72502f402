// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "reconstruction/coarse/coarse_mesh.h"
#include "reconstruction/factored_surface.h"
#include "systems/polyharmonic_system.h"

namespace dd {

/// Solves K w = 0, K = L M⁻¹ L, with given values at constrained vertices by the factor of L alone,
/// which a surface has anyway: on large meshes the factor of K takes most of a bind and three times
/// the memory.
///
/// In the mixed formulation (Ciarlet and Raviart 1974) the second unknown is v = M⁻¹ L w. On free
/// vertices F it is harmonic, L_F: v = 0, so its values λ on the rim C, the constrained vertices
/// with a free neighbour, determine it: v = H λ, and w by L_F: w = M v. What is left is one
/// equation for λ (Glowinski and Pironneau 1979), symmetric and positive definite:
///
///   (M_C + Hᵀ M H) λ = L_C: h,   h harmonic with the given values.
///
/// It is solved by conjugate gradients, with two solves of L an iteration. The preconditioner is
/// the inverse of the same matrix on a coarse mesh that has all of the rim and next to it the
/// density of the mesh: there
///
///   M_C⁻¹ − M_C⁻¹ L_CF K_FF⁻¹ L_FC M_C⁻¹,
///
/// which the small factor of its K gives. Each iteration leaves a tenth to a fifth of the error,
/// whatever the size of the mesh.
class MixedBilaplacian {
 public:
  /// surface: factored; its operators without stiffness; no component of it without constrained
  /// vertices. coarse: of its active faces. Both must outlive the result. Throws UnsolvableSurface
  /// where K is singular on the coarse mesh.
  MixedBilaplacian(const FactoredSurface& surface, const CoarseMesh& coarse);

  /// values: n×4; rows of constrained vertices are read. Returns F×4, rows as in Region::free;
  /// valid until the next call. Throws UnsolvableSurface where it does not converge.
  const Rows& extend(const Rows& values);

 private:
  /// K of the coarse mesh.
  struct CoarsePlate {
    CoarsePlate(const FactoredSurface& surface, const CoarseMesh& mesh,
                const std::vector<int>& rim);
    /// Multiplies by the preconditioner, |C|×4.
    Rows operator()(const Rows& residual, ThreadPool& pool);

    Region region;
    SurfaceOperators operators;
    std::unique_ptr<PolyharmonicSystem> energy;
    Eigen::VectorXd masses;  // M_C
    SparseMatrix coupling;   // L_FC, free rows of the coarse mesh × C
    SparseCholesky::SolveScratch scratch;
    Rows solution;
  };

  /// −L_FC λ, rows in the surface's order.
  void take_rim_values(const Rows& lambda, Rows& right) const;
  /// L_CF x, |C|×4.
  Rows flux(const Rows& x) const;
  /// The product with M_C + Hᵀ M H.
  Rows product(const Rows& lambda);
  void multiply_by_masses(Rows& rows) const;

  const FactoredSurface& surface_;
  std::vector<int> rim_;
  SparseMatrix coupling_;  // L_FC, free rows in the surface's order × C
  CoarsePlate coarse_;
  Rows force_, work_, result_;
};

}  // namespace dd
