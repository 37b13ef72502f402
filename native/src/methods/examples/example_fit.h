// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "methods/examples/example_system.h"
#include "methods/examples/weight_limits.h"

namespace dd {

/// Finds the weights of the examples that minimize the energy given at Examples, over the free p'
/// and w at once.
///
/// The positions p' = L⁻¹ div(G T(w)ᵀ) are eliminated with the factor that all methods share, and
/// Newton's method finds w. The derivatives J_i = ∂T/∂w_i are projected to the part that positions
/// can't follow, Ĵ_i = J_i − G L⁻¹ div J_i, with one solve for each example. The Hessian is ĴᵀDĴ +
/// r · ∂²T/∂w_i∂w_k, r the residual. ĴᵀDĴ equals JᵀDJ − Bᵀ L⁻¹ B with B = div J, but is computed
/// from Ĵ, as the difference would cancel most digits of single precision.
///
/// Choices that the literature leaves open:
/// - Gauss–Newton, without r · T'', isn't enough. Handles hardly determine how overlapping examples
///   share a bend; along such valleys of the energy r · T'' dominates the Hessian. With ten
///   examples Gauss–Newton had not converged after 10 steps, Newton takes 3 to 8. If the Hessian
///   isn't positive definite or the energy rises, a multiple of diag(D_i) is added (Levenberg,
///   Marquardt).
/// - Logarithms are chosen to be continuous over the surface: ExampleTurns.
/// - U_ij is defined on the triangle's plane, as exp(−r_ij) times the example's own gradient. So
///   w_i = 1 gives the example exactly, for triangles without area as well, and the normal in (15)
///   has no influence.
/// - Weights are measured by D_i = Σ_j A_j ‖G_j(p) (S_ij − I)ᵀ‖², the size of the example's
///   difference from rest: a change of a corner of the mouth counts by the mouth, not by the body.
/// - Where handles don't determine the weights, a guess g does, which is also the start of every
///   update; so the result depends on the handles alone. For the guess, positions and gradients are
///   blended linearly. Example i alone fits the handles best at t_i in [0, 1], with the energy E_i,
///   and the rest pose with E_0. Then g_i = t_i a_i/E_i / (1/E_0 + Σ_k a_k/E_k), a_i = 1 − E_i/E_0.
///   So g is example i if the handles are exactly there, whatever other examples could reach them.
///   g is zero at rest and for examples that don't move the handles, and continuous. E_i = E_0 − 2
///   t_i f_i + t_i² c_i with f_i = Σ_v x_v · q_iv, x the handles' displacements, q_i and c_i
///   constants, so a guess costs one dot product for each example. From rest the energy has no
///   slope towards an example that turns a limb by 180°, and one of the wrong sign beyond.
/// - o(w) is the distance of w from [0, 1]. Its fourth power makes small overshoot cheap: at 0.24
///   it costs as much as a weight 1 away from its guess. If handles go far from the examples, the
///   surface stretches instead of exaggerating them. μ = 0.01 turned a bulging muscle into one that
///   pinches the limb.
/// - Limited weights are found by the same steps, each the minimizer within the limits
///   (limited_step()), from the guess clamped to the limits.
template <class Real>
class ExampleFit {
 public:
  /// of must outlive this. hold: for each handle.
  ExampleFit(const ExampleSurface& of, std::vector<HandleHold> hold);

  /// Returns the weights. offsets: displacements of the handles' rows, in the surface's order.
  /// stiffness: s. The weights aren't finite if the motion is too large to fit.
  Eigen::VectorXd find(const Rows& offsets, bool rotation_only, double stiffness,
                       const WeightLimits& limits);

  /// The system, which holds the pose and solution of the weights that find() returned last.
  ExampleSystem<Real>& system() { return system_; }
  const std::vector<HandleHold>& hold() const { return system_.hold(); }
  double bytes() const;

 private:
  /// Constants of the guess and of the restraint, see above.
  struct GuessConstants {
    Eigen::VectorXd sizes;      // D_i
    Eigen::VectorXd constants;  // c_i
    Eigen::MatrixXd forces;     // q_i: a column for each example, 4 rows for each handle vertex
  };
  const GuessConstants& guess_constants(bool rotation_only);
  /// Solves for p' with these weights. Returns the first sum of the energy.
  double solve_for_weights(const Eigen::VectorXd& weights, bool rotation_only);
  /// The guess g. at_rest: E_0. handles: x, 4 numbers for each handle vertex.
  Eigen::VectorXd guess(const GuessConstants& guess_constants, double at_rest,
                        const Eigen::VectorXd& handles) const;
  /// Half the derivatives of the first sum of the energy by w, at the last weights.
  void find_derivatives(Eigen::MatrixXd& hessian, Eigen::VectorXd& gradient);

  Index example_count_;
  double area_;  // of the surface
  ExampleSystem<Real> system_;
  std::vector<Rows> position_responses_;  // L⁻¹ div J_i of each example, at the last derivatives
  std::unique_ptr<GuessConstants> guess_constants_[2];  // [rotation_only]
};

}  // namespace dd
