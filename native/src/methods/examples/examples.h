// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "methods/examples/example_fit.h"
#include "methods/examples/handle_residual.h"
#include "methods/examples/stance.h"
#include "methods/method.h"
#include "reconstruction/coarse/coarse_surface.h"

namespace dd {

/// The method in the precision of the Poisson system.
std::unique_ptr<Method> make_examples(BoundSurface& bound);

/// Posing by example, or mesh-based inverse kinematics (Sumner, Zwicker, Gotsman, Popović 2005), on
/// the paper's formulation for surfaces (§5) in place of that with fourth points. Examples p_i of S
/// span the deformation gradients: with S_ij from S to example i by (15), S_ij = R_ij U_ij,
///
///   T_j(w) = exp(Σ_i w_i log R_ij) · (I + Σ_i w_i (U_ij − I))
///
/// and the pose is the one nearest to what the handles ask for, over the free p' and w at once,
///
///   E(w, p') = Σ_j A_j ‖G_j(p') − G_j(p) T_j(w)ᵀ‖² + s Σ_i D_i (κ (w_i − g_i)² + μ o(w_i)⁴)
///
/// (ExampleFit). Where nothing is fixed, all of it is relative to how the handles stand together
/// (Stances). Weights need no dense surface: where more than some 2,000 vertices are free they are
/// fitted on a coarse one.
///
/// With iterations of Refined, that pose q with all handles let go is what S is for detail
/// transfer: what the handles ask for beyond it, first as smooth as the base's functions
/// (HandleResidual), turns the pose's gradients, L p' = div(T_jᵀ R_jᵀ), R_j refined from q to S'
/// (Refinement::find_from()). Without, the handles are met as the energy has it.
///
/// - rotation_only leaves U_ij out: limbs bend, nothing swells; examples that swell are not met.
/// - Weights given, the handles are let go: their vertices are free in a system of its own, and
///   what then floats is placed by ExamplePlaces.
/// - A handle that only places gives the mean of its vertices: how these turn, and what shape they
///   have, is the examples' to say (ExampleSystem).
/// Without examples, or with such as equal the rest, it is p' = L⁻¹ div(G) with handles.
template <class Real>
class Examples : public Method {
 public:
  explicit Examples(BoundSurface& bound);
  void update(const Frame& frame, const MethodOptions& options) override;
  MethodFindings findings() const override;
  double bytes() const override;

 private:
  void show(const std::vector<double>& weights, const MethodOptions& options, Rows& offsets);
  /// The pose of the weights, with the handles where they are told, with their vertices let go, and
  /// beyond it.
  void hold_pose(const MethodOptions& options, Rows& offsets);
  void let_go(bool rotation_only, Rows& offsets);
  void solve_for_pose(ExampleSystem<Real>& system, bool rotation_only) const;
  void go_beyond(const MethodOptions& options, Rows& offsets);
  /// Moves the places of rows from first to the fixed ones, unless there is but one stance.
  template <class Move>
  void replace(int first, Rows& offsets, const Move& move) const;
  /// Gives all rows but fixed ones the stance.
  void stand(const Stance& stance, Rows& offsets) const;

  BoundSurface& bound_;
  Stances stances_;
  ExampleSurface fine_;
  std::unique_ptr<CoarseSurface> coarse_;
  std::unique_ptr<ExampleSurface> coarse_examples_;
  Eigen::VectorXd weights_;  // of the last update
  std::unique_ptr<ExampleFit<Real>> fit_;
  std::unique_ptr<ExampleSystem<Real>> held_, let_go_;  // of the fine surface
  std::unique_ptr<HandleResidual> residual_;
  Reconstruction reconstruction_;
  Rows coarse_offsets_;
};

}  // namespace dd
