// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "methods/detail.h"
#include "methods/normal_displacement.h"

namespace dd {

/// Displacement volumes (§1, Fig. 4), after Botsch and Kobbelt 2003: the prisms between the
/// triangles of B and of S keep their volume. With W_i a third of the volume of the prisms around
/// vertex i, minimizes
///
///   ‖∇p' − ∇p_T‖² + ‖p' − p_N‖² / ℓ² + ‖W(p', q') − W(p, q)‖² / μ
///
/// with norms of the masses M, the last of M⁻¹. Volumes alone would let the surface slide and
/// wrinkle. The gradients of detail transfer (p_T) keep it smooth, the positions of normal
/// displacements (p_N) keep it over its base. ℓ is four times, √μ a tenth of the mean height of the
/// prisms. Local self-intersections would invert prisms, which the volume term prevents.
///
/// The minimization is non-linear: Gauss-Newton steps, each solved by conjugate gradients with one
/// factor. It is too slow for dragging.
class DisplacementVolumes : public Method {
 public:
  /// progress: called during the factorization so that it can be cancelled, with the fraction 0.
  explicit DisplacementVolumes(BoundSurface& bound, const Progress& progress = {});
  void update(const Frame& frame, const MethodOptions& options) override;
  MethodFindings findings() const override;
  double bytes() const override;

 private:
  using Vector = Eigen::VectorXd;

  /// W − W_rest of the free rows. Also stores the volumes' gradients at this surface in
  /// volume_gradients_.
  Vector volume_changes(const Rows& surface, const Rows& base);
  Rows transposed_jacobian_product(const Vector& multipliers) const;  // Jᵀ λ, J = ∂W/∂p
  Vector jacobian_product(const Rows& displacement) const;            // J x
  /// An approximation of (J H⁻¹ Jᵀ)⁻¹ residual.
  Vector preconditioned(const Vector& residual) const;
  /// The displacement H⁻¹ Jᵀ λ with (J H⁻¹ Jᵀ + μ M) λ = wanted, H = L + M / ℓ², by conjugate
  /// gradients. check_cancelled: called in each iteration; may throw to cancel.
  template <class CheckCancelled>
  Rows restoring_displacement(const Vector& wanted, const CheckCancelled& check_cancelled) const;

  BoundSurface& bound_;
  Detail detail_;
  NormalDisplacement normal_;
  Triangles free_triangles_;                       // those with a free corner; corners are rows
  std::vector<Eigen::Matrix3d> volume_gradients_;  // of each prism: ∂V/∂p of the corners as columns
  Vector masses_, rest_volumes_;
  double mean_height_ = 0;                  // of the prisms
  SparseMatrix system_;                     // H
  std::unique_ptr<SparseCholesky> factor_;  // of H; null if S = B, without volumes to keep
  double volume_error_ = 0;
  bool converged_ = true;
};

}  // namespace dd
