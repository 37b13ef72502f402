// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "methods/examples/example_fit.h"
#include "methods/examples/handle_residual.h"
#include "methods/examples/joint_rigid_motion.h"
#include "methods/method.h"
#include "reconstruction/coarse/coarse_surface.h"

namespace dd {

/// Creates the method in the precision of the Poisson system.
std::unique_ptr<Method> make_examples(BoundSurface& bound);

/// Posing by example, or mesh-based inverse kinematics (Sumner, Zwicker, Gotsman, Popović 2005),
/// with the paper's formulation for surfaces (§5) in place of fourth points. Examples p_i of S span
/// the deformation gradients: with S_ij from S to example i by (15), S_ij = R_ij U_ij,
///
///   T_j(w) = exp(Σ_i w_i log R_ij) · (I + Σ_i w_i (U_ij − I))
///
/// The weights w and the free positions p' minimize, with the handles' vertices given,
///
///   E(w, p') = Σ_j A_j ‖G_j(p') − G_j(p) T_j(w)ᵀ‖² + s Σ_i D_i (κ (w_i − g_i)² + μ o(w_i)⁴)
///
/// (ExampleFit explains the second sum). If no fixed vertex is adjacent to a free one, all of it is
/// relative to the joint rigid motion of the handles (JointRigidMotions). With 2,000 free vertices
/// or more and no free handle, the weights are fitted on a coarse surface if CoarseSurface::make()
/// gives one.
///
/// With Refined::iterations > 0 the handles' motion beyond the examples deforms the pose as detail
/// transfer deforms S. q is the pose of w with all handle vertices free. HandleResidual extends the
/// handles' differences from q by the base's functions. Then L p' = div(T_jᵀ R_jᵀ), with rotations
/// R_j refined from q to S' (Refinement::find_from()). Without iterations p' minimizes E for these
/// weights.
///
/// - rotation_only omits U_ij: limbs bend, but nothing swells, and examples that swell aren't
///   reproduced.
/// - If weights are given, the handles have no effect: their vertices are free in a system of its
///   own, and ExamplePlaces places floating components.
/// - A free handle prescribes the mean of its vertices. The examples give their rotation and shape
///   (ExampleSystem).
///
/// Without examples, or if all equal the rest pose, p' = L⁻¹ div(G) with the handles as
/// constraints.
template <class Real>
class Examples : public Method {
 public:
  explicit Examples(BoundSurface& bound);
  void update(const Frame& frame, const MethodOptions& options) override;
  MethodFindings findings() const override;
  double bytes() const override;

 private:
  /// The pose of the given weights, without handles.
  void pose_by_given_weights(const std::vector<double>& weights, const MethodOptions& options,
                             Rows& offsets);
  /// The pose of weights_ with the handles' vertices as constraints.
  void pose_constrained(const MethodOptions& options, Rows& offsets);
  /// The pose of weights_ with the handles' vertices free.
  void pose_unconstrained(bool rotation_only, Rows& offsets);
  void solve_for_pose(ExampleSystem<Real>& system, bool rotation_only) const;
  /// The pose of weights_, refined from that with the handles' vertices free to their motions.
  void refine_towards_handles(const MethodOptions& options, Rows& offsets);
  /// Applies move to the positions of rows from first up to the fixed ones. No effect if
  /// JointRigidMotions::fixed().
  template <class Move>
  void move_positions(int first, Rows& offsets, const Move& move) const;
  /// Applies the motion to all rows but fixed ones.
  void apply_joint_motion(const JointRigidMotion& joint_motion, Rows& offsets) const;

  BoundSurface& bound_;
  JointRigidMotions joint_motions_;
  ExampleSurface fine_;
  std::unique_ptr<CoarseSurface> coarse_;
  std::unique_ptr<ExampleSurface> coarse_examples_;
  Eigen::VectorXd weights_;  // of the last update, found or given
  std::unique_ptr<ExampleFit<Real>> fit_;
  std::unique_ptr<ExampleSystem<Real>> constrained_, unconstrained_;  // on the fine surface
  std::unique_ptr<HandleResidual> residual_;
  Reconstruction reconstruction_;
  Rows coarse_offsets_;
};

}  // namespace dd
