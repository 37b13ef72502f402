// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "methods/detail.h"
#include "methods/normal_displacement.h"

namespace dd {

/// Displacement volumes (§1, Fig. 4), after Botsch and Kobbelt 2003: the prisms between the
/// triangles of B and of S keep their volume. With W_i a third of the volumes of vertex i's prisms,
/// minimize
///
///   ‖∇p' − ∇p_T‖² + ‖p' − p_N‖² / ℓ² + ‖W(p', q') − W(p, q)‖² / μ
///
/// (norms weighted by the masses). Volumes alone leave the surface free to slide and to wrinkle:
/// the gradients of MethodKind::detail (p_T) keep it smooth, the place of normal displacements (p_N)
/// keeps it over its base; ℓ is four times, √μ a tenth of the mean height of the prisms. Local
/// self-intersections would turn prisms inside out, which their volumes forbid.
///
/// Not linear: relaxed by Gauss-Newton steps, each solved by conjugate gradients on one factor.
/// Slow, and not meant for dragging.
class DisplacementVolumes : public Method {
 public:
  /// progress: asked while a factor is made, and told no fraction.
  explicit DisplacementVolumes(BoundSurface& bound, const Progress& progress = {});
  void update(const Frame& frame, const MethodOptions& options) override;
  MethodFindings findings() const override;
  double bytes() const override;

 private:
  using Vector = Eigen::VectorXd;

  /// W of the free rows less that at rest; also takes the gradients there.
  Vector missing_volumes(const Rows& surface, const Rows& base);
  Rows transposed(const Vector& multipliers) const;  // Jᵀ λ, J = ∂W/∂p
  Vector applied(const Rows& displacement) const;    // J x
  Vector preconditioned(const Vector& residual) const;
  /// H⁻¹ Jᵀ λ with (J H⁻¹ Jᵀ + μ M) λ = wanted, H = L + M / ℓ².
  /// go_on: called in each round, may throw.
  template <class GoOn>
  Rows shift_for(const Vector& wanted, const GoOn& go_on) const;

  BoundSurface& bound_;
  Detail detail_;
  NormalDisplacement normal_;
  Triangles triangles_;                     // the active ones, rows for corners
  std::vector<Eigen::Matrix3d> gradients_;  // ∂V/∂p of the corners, as columns
  Vector masses_, rest_volumes_;
  double height_ = 0;  // mean height of the prisms
  SparseMatrix metric_;
  std::unique_ptr<SparseCholesky> factor_;  // of H; none where there is no volume to keep
  double volume_error_ = 0;
  bool converged_ = true;
};

}  // namespace dd
