// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "methods/examples/example_system.h"
#include "methods/examples/weight_limits.h"

namespace dd {

/// The weights of the examples whose pose comes nearest to what the handles ask for, over the free
/// p' and w at once: see Examples, where the energy stands.
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
/// - Weights that are limited are found by the same steps, each the best that stays within the
///   limits (limited_step()), from the guess as far as it does.
template <class Real>
class ExampleFit {
 public:
  /// of: outlives it. hold: of each handle.
  ExampleFit(const ExampleSurface& of, std::vector<HandleHold> hold);

  /// offsets: the displacement of the handles' rows, in the surface's order. stiffness: s. Not
  /// finite where no weights fit.
  Eigen::VectorXd find(const Rows& offsets, bool rotation_only, double stiffness,
                       const WeightLimits& limits);

  /// With what find() returned as its pose, solved for.
  ExampleSystem<Real>& system() { return system_; }
  const std::vector<HandleHold>& hold() const { return system_.hold(); }
  double bytes() const;

 private:
  /// The energy at the examples, and what it is measured by.
  struct Starts {
    Eigen::VectorXd sizes;      // D_i
    Eigen::VectorXd constants;  // c_i
    Eigen::MatrixXd forces;     // q_i, a column an example, 4 rows a handle's vertex
  };
  const Starts& starts(bool rotation_only);
  /// Solves for the pose with these weights and takes it; the energy's first sum.
  double take(const Eigen::VectorXd& weights, bool rotation_only);
  /// The guess g. at_rest: E_0. handles: displacements of their vertices, 4 numbers each.
  Eigen::VectorXd guess(const Starts& starts, double at_rest, const Eigen::VectorXd& handles) const;
  /// Half the derivatives of the energy's first sum in the pose taken.
  void derive(Eigen::MatrixXd& hessian, Eigen::VectorXd& gradient);

  Index example_count_;
  double area_;  // of the surface
  ExampleSystem<Real> system_;
  std::vector<Rows> followed_;         // of each example, in the last derivatives
  std::unique_ptr<Starts> starts_[2];  // whole gradients, rotations
};

}  // namespace dd
