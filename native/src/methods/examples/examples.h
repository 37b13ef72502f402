// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "methods/examples/example_system.h"
#include "methods/examples/handle_residual.h"
#include "methods/examples/stance.h"
#include "methods/method.h"

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
/// With p' = L⁻¹ div(G T(w)ᵀ) eliminated, on the factor that all methods share, this is Newton's
/// method in w. First derivatives are J_i = ∂T/∂w_i less the part that positions can follow,
/// Ĵ_i = J_i − G L⁻¹ div J_i, a solve for each example; the Hessian is ĴᵀDĴ + r · ∂²T/∂w_i∂w_k, r
/// the misfit. ĴᵀDĴ is JᵀDJ − Bᵀ L⁻¹ B with B = div J, but as products of what remains, so that
/// what cancels doesn't cost the digits of single precision.
///
/// What the literature leaves open:
/// - Gauss–Newton, which leaves r · T'' out, isn't enough: a handle says next to nothing about how
///   overlapping examples share a bend, and along such valleys r · T'' is most of the Hessian. With
///   ten of them it had not converged after 10 steps; Newton's takes 3 to 8. Where the Hessian is
///   not positive or the energy rises it is damped (Levenberg, Marquardt), examples by their sizes.
/// - Logarithms are chosen to be continuous over the surface: ExampleTurns.
/// - U_ij is what the turn taken leaves of the example's own gradient, on the triangle's plane: so
///   w_i = 1 is the example exactly, for triangles without area as well. (15)'s normal has no say.
/// - Weights are judged by D_i = Σ_j A_j ‖G_j(p) (S_ij − I)ᵀ‖², how much the example differs from
///   the rest: a change of a corner of the mouth is measured by the mouth, not by the body.
/// - What the handles leave open is decided by a guess g at the weights, which is also where every
///   update starts: the result depends on the handles alone. With positions and constant gradients
///   blended linearly, example i alone would fit them best at t_i in 0 to 1, with energy E_i, where
///   the rest has E_0; g_i = t_i a_i/E_i / (1/E_0 + Σ_k a_k/E_k), a_i = 1 − E_i/E_0. So g is an
///   example where the handles are at it, whatever else could reach them, zero at rest and for
///   examples that don't move the handles, and continuous in between. As E_i = E_0 − 2 t_i f_i +
///   t_i² c_i with f_i = Σ_v x_v · q_iv, x the handles' displacements, q_i and c_i constants, it
///   costs nothing. A start at rest would find no slope towards an example that turns a limb by
///   half a turn, and beyond it the wrong one.
/// - o(w) is how far w is out of 0 to 1, to the fourth power: up to a third is cheap; a handle far
///   from what the examples know stretches the surface instead of exaggerating them. With a
///   thirtieth of this weight, a muscle that bulges was turned into one that pinches the limb.
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
  /// The energy at the examples, and what it is measured by.
  struct Starts {
    Eigen::VectorXd sizes;      // D_i
    Eigen::VectorXd constants;  // c_i
    Eigen::MatrixXd forces;     // q_i, a column an example, 4 rows a handle's vertex
  };
  void show(const std::vector<double>& weights, const MethodOptions& options, Rows& offsets);
  const Starts& starts(bool rotation_only);
  /// Makes the system anew where it holds the handles in another way.
  void make(std::unique_ptr<ExampleSystem<Real>>& system, std::vector<HandleHold> hold);
  /// Solves for the pose with these weights and takes it; the energy's first sum.
  double take(const Eigen::VectorXd& weights, bool rotation_only);
  /// The guess g. at_rest: E_0. handles: displacements of their vertices, 4 numbers each.
  Eigen::VectorXd guess(const Starts& starts, double at_rest, const Eigen::VectorXd& handles) const;
  /// Half the derivatives of the energy's first sum in the pose taken.
  void derive(Eigen::MatrixXd& hessian, Eigen::VectorXd& gradient);
  /// The weights of the least energy, with their pose taken.
  void fit(const MethodOptions& options);

  /// Solves for the pose that was found with all handles let go, and from there, as detail transfer
  /// does from S, for what they ask for beyond it.
  void go_beyond(const MethodOptions& options, Rows& offsets);
  /// Gives all rows but fixed ones the stance.
  void stand(const Stance& stance, Rows& offsets) const;
  void let_go(bool rotation_only, Rows& offsets);

  BoundSurface& bound_;
  Stances stances_;
  ExampleTurns turns_;
  Reconstruction reconstruction_;
  std::unique_ptr<HandleResidual> residual_;
  Eigen::VectorXd weights_;  // of the last update
  std::unique_ptr<ExampleSystem<Real>> fitted_, let_go_;
  std::unique_ptr<Starts> starts_[2];  // of the fitted one: whole gradients, rotations
};

}  // namespace dd
