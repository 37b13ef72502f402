// SPDX-License-Identifier: GPL-3.0-or-later
#include "methods/examples/example_fit.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <utility>

namespace dd {

namespace {

// κ and μ: weights of the pull towards the guess and of the penalty on overshoot, both relative to
// D_i. Tuned together with native/bench/posing: tripled from 1e-2 and 3, so that the surface leaps
// less between weights that fit alike.
constexpr double kExampleGuessWeight = 3e-2;
constexpr double kOvershootWeight = 9;
// Lower bound of D_i as a fraction of the surface's area: D_i of an example equal to rest is a
// divisor.
constexpr double kMinRelativeSize = 1e-9;
// Fraction of D_i added to the divisors c_i and E_i of the guess: examples that don't move the
// handles have c_i = 0, those that fit exactly E_i = 0.
constexpr double kGuessRegularization = 1e-6;
constexpr int kMaxNewtonSteps = 10;  // Newton takes 3 to 8 with ten examples
// Largest change of a weight in the last step: after an undamped Newton step of this length the
// error is far smaller, after a damped one it is of the same size.
constexpr double kConvergedStep = 1e-2, kConvergedDampedStep = 1e-3;
// Damping, a multiple of diag(D_i) added to the Hessian: less than the first counts as undamped,
// beyond the second the search ends with its current weights.
constexpr double kMinDamping = 1e-4, kMaxDamping = 1e6;

/// o(w): the signed distance of w from [0, 1].
double overshoot(double w) { return w - std::clamp(w, 0.0, 1.0); }

/// The energy's second sum, s Σ_i D_i (κ (w_i − g_i)² + μ o(w_i)⁴).
struct WeightPenalty {
  Eigen::VectorXd sizes, guess;  // s D_i, g_i

  double energy(const Eigen::VectorXd& weights) const {
    double sum = 0;
    for (Index i = 0; i < weights.size(); ++i)
      sum += sizes[i] * (kExampleGuessWeight * std::pow(weights[i] - guess[i], 2) +
                         kOvershootWeight * std::pow(overshoot(weights[i]), 4));
    return sum;
  }
  /// Adds half of its derivatives.
  void add_to(Eigen::MatrixXd& hessian, Eigen::VectorXd& gradient,
              const Eigen::VectorXd& weights) const {
    for (Index i = 0; i < weights.size(); ++i) {
      const double out = overshoot(weights[i]);
      gradient[i] += sizes[i] * (kExampleGuessWeight * (weights[i] - guess[i]) +
                                 2 * kOvershootWeight * out * out * out);
      hessian(i, i) += sizes[i] * (kExampleGuessWeight + 6 * kOvershootWeight * out * out);
    }
  }
};

}  // namespace

template <class Real>
ExampleFit<Real>::ExampleFit(const ExampleSurface& of, std::vector<HandleHold> hold)
    : example_count_(Index(of.examples.size())),
      area_(of.surface.operators.metric.areas.sum()),
      system_(of, std::move(hold)) {
  system_.pass().allocate_derivatives();
}

template <class Real>
double ExampleFit<Real>::solve_for_weights(const Eigen::VectorXd& weights, bool rotation_only) {
  return system_.pass().misfit(system_.solve([&](int section, double* rows) {
    system_.pass().pose(section, weights, rotation_only, rows);
  }));
}

template <class Real>
const typename ExampleFit<Real>::GuessConstants& ExampleFit<Real>::guess_constants(
    bool rotation_only) {
  std::unique_ptr<GuessConstants>& made = guess_constants_[rotation_only];
  if (made) return *made;
  const Index count = example_count_;
  auto guess_constants = std::make_unique<GuessConstants>();
  guess_constants->sizes.resize(count);
  guess_constants->constants.resize(count);
  guess_constants->forces.resize(system_.prescribed().size(), count);
  for (Index i = 0; i < count; ++i) {
    const Eigen::VectorXd alone = Eigen::VectorXd::Unit(count, i);
    guess_constants->constants[i] =
        system_.pass().misfit(system_.solve_at_rest([&](int section, double* rows) {
          system_.pass().pose(section, alone, rotation_only, rows);
        }));
    guess_constants->sizes[i] = system_.pass().squared_size() + kMinRelativeSize * area_;
    const Rows forces = system_.forces();
    guess_constants->forces.col(i) =
        Eigen::Map<const Eigen::VectorXd>(forces.data(), forces.size());
  }
  made = std::move(guess_constants);
  return *made;
}

template <class Real>
Eigen::VectorXd ExampleFit<Real>::guess(const GuessConstants& guess_constants, double at_rest,
                                        const Eigen::VectorXd& handles) const {
  const Eigen::VectorXd force_products = guess_constants.forces.transpose() * handles;
  Eigen::VectorXd best_fractions(force_products.size()), relative_fits(force_products.size());
  double whole = 1 / at_rest;
  for (Index i = 0; i < force_products.size(); ++i) {
    const double least = kGuessRegularization * guess_constants.sizes[i],
                 constant = guess_constants.constants[i];
    best_fractions[i] = std::clamp(force_products[i] / (constant + least), 0.0, 1.0);
    const double left = std::max(0.0, at_rest - 2 * best_fractions[i] * force_products[i] +
                                          best_fractions[i] * best_fractions[i] * constant);
    relative_fits[i] = std::max(0.0, 1 - left / at_rest) / (left + least);
    whole += relative_fits[i];
  }
  return best_fractions.cwiseProduct(relative_fits) / whole;
}

template <class Real>
void ExampleFit<Real>::find_derivatives(Eigen::MatrixXd& hessian, Eigen::VectorXd& gradient) {
  position_responses_.resize(size_t(example_count_));
  for (int i = 0; i < example_count_; ++i)
    position_responses_[size_t(i)] = system_.solve_at_rest(
        [&](int section, double* rows) { system_.pass().derivative(i, section, rows); });
  system_.pass().second_order(position_responses_, hessian, gradient);
}

template <class Real>
Eigen::VectorXd ExampleFit<Real>::find(const Rows& offsets, bool rotation_only, double stiffness,
                                       const WeightLimits& limits) {
  system_.prescribe_handles(offsets);
  const GuessConstants& at = guess_constants(rotation_only);
  Eigen::VectorXd weights = Eigen::VectorXd::Zero(example_count_);
  const double at_rest = solve_for_weights(weights, rotation_only);
  if (example_count_ == 0 || at_rest == 0) return weights;

  const Rows& prescribed = system_.prescribed();
  const Eigen::Map<const Eigen::VectorXd> handles(prescribed.data(), prescribed.size());
  const WeightPenalty penalty = {stiffness * at.sizes, guess(at, at_rest, handles)};
  const auto try_out = [&](const Eigen::VectorXd& tried) {
    weights = tried;
    return solve_for_weights(weights, rotation_only) + penalty.energy(weights);
  };
  double energy = try_out(limits.within(penalty.guess));

  // Weights are scaled by √D_i, so that damping affects examples of any size alike.
  const Eigen::VectorXd weight_units = at.sizes.cwiseSqrt().cwiseInverse();
  const auto unit = weight_units.asDiagonal();
  // Relative increase of the energy that is put down to rounding. Safety: some ten times the
  // rounding unit of Real and, in double precision, of a sum over the triangles.
  const double rounding = sizeof(Real) == sizeof(float) ? 1e-6 : 1e-12;
  double damping = 0;
  Eigen::MatrixXd hessian;
  Eigen::VectorXd gradient;
  for (int step = 0; step < kMaxNewtonSteps; ++step) {
    find_derivatives(hessian, gradient);
    penalty.add_to(hessian, gradient, weights);
    const Eigen::VectorXd from = weights, scaled_gradient = unit * gradient;
    for (;; damping = std::max(10 * damping, kMinDamping)) {
      if (damping > kMaxDamping) {
        try_out(from);
        return weights;
      }
      Eigen::MatrixXd damped = unit * hessian * unit;
      damped.diagonal().array() += damping;
      const Eigen::LLT<Eigen::MatrixXd> factor(damped);
      if (factor.info() != Eigen::Success) continue;
      const Eigen::VectorXd step_direction =
          limits.any ? limited_step(damped, scaled_gradient,
                                    (limits.lower - from).cwiseQuotient(weight_units),
                                    (limits.upper - from).cwiseQuotient(weight_units))
                     : Eigen::VectorXd(factor.solve(-scaled_gradient));
      const double now = try_out(limits.within(from + unit * step_direction));
      const Eigen::VectorXd change = weights - from;
      const double step_size = change.cwiseAbs().maxCoeff();
      if (step_size < (damping < kMinDamping ? kConvergedStep : kConvergedDampedStep))
        return weights;
      if (!(now <= energy * (1 + rounding))) continue;
      const double predicted_decrease = damping * step_direction.squaredNorm() -
                                        2 * step_direction.dot(scaled_gradient) -
                                        step_direction.dot(damped * step_direction);
      damping *= energy - now > 0.7 * predicted_decrease   ? 0.03
                 : energy - now > 0.3 * predicted_decrease ? 0.3
                                                           : 3;
      energy = now;
      break;
    }
  }
  return weights;
}

template <class Real>
double ExampleFit<Real>::bytes() const {
  double bytes = system_.bytes();
  for (const Rows& rows : position_responses_)
    bytes += static_cast<double>(rows.size() * Index(sizeof(double)));
  for (const auto& guess_constants : guess_constants_)
    if (guess_constants)
      bytes += static_cast<double>(guess_constants->forces.size() * Index(sizeof(double)));
  return bytes;
}

template class ExampleFit<float>;
template class ExampleFit<double>;

}  // namespace dd
