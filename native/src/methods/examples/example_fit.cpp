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
constexpr double kToGuess = 3e-2;
constexpr double kBeyond = 9;
// Lower bound of D_i as a fraction of the surface's area: D_i of an example equal to rest is a
// divisor.
constexpr double kLeastSize = 1e-9;
// Fraction of D_i added to the divisors c_i and E_i of the guess: examples that don't move the
// handles have c_i = 0, those that fit exactly E_i = 0.
constexpr double kIrrelevant = 1e-6;
constexpr int kMostSteps = 10;  // Newton takes 3 to 8 with ten examples
// Largest change of a weight in the last step: after an undamped Newton step of this length the
// error is far smaller, after a damped one it is of the same size.
constexpr double kLastStep = 1e-2, kLastDampedStep = 1e-3;
// Damping, a multiple of diag(D_i) added to the Hessian: less than the first counts as undamped,
// beyond the second the search ends with its current weights.
constexpr double kLeastDamping = 1e-4, kMostDamping = 1e6;

/// o(w): the signed distance of w from [0, 1].
double beyond(double w) { return w - std::clamp(w, 0.0, 1.0); }

/// The energy's second sum, s Σ_i D_i (κ (w_i − g_i)² + μ o(w_i)⁴).
struct Restraint {
  Eigen::VectorXd sizes, guess;  // s D_i, g_i

  double energy(const Eigen::VectorXd& weights) const {
    double sum = 0;
    for (Index i = 0; i < weights.size(); ++i)
      sum += sizes[i] * (kToGuess * std::pow(weights[i] - guess[i], 2) +
                         kBeyond * std::pow(beyond(weights[i]), 4));
    return sum;
  }
  /// Adds half of its derivatives.
  void add_to(Eigen::MatrixXd& hessian, Eigen::VectorXd& gradient,
              const Eigen::VectorXd& weights) const {
    for (Index i = 0; i < weights.size(); ++i) {
      const double out = beyond(weights[i]);
      gradient[i] +=
          sizes[i] * (kToGuess * (weights[i] - guess[i]) + 2 * kBeyond * out * out * out);
      hessian(i, i) += sizes[i] * (kToGuess + 6 * kBeyond * out * out);
    }
  }
};

}  // namespace

template <class Real>
ExampleFit<Real>::ExampleFit(const ExampleSurface& of, std::vector<HandleHold> hold)
    : example_count_(Index(of.examples.size())),
      area_(of.surface.operators.metric.areas.sum()),
      system_(of, std::move(hold)) {
  system_.pass().make_room();
}

template <class Real>
double ExampleFit<Real>::take(const Eigen::VectorXd& weights, bool rotation_only) {
  return system_.pass().misfit(system_.solve([&](int section, double* rows) {
    system_.pass().pose(section, weights, rotation_only, rows);
  }));
}

template <class Real>
const typename ExampleFit<Real>::Starts& ExampleFit<Real>::starts(bool rotation_only) {
  std::unique_ptr<Starts>& made = starts_[rotation_only];
  if (made) return *made;
  const Index count = example_count_;
  auto starts = std::make_unique<Starts>();
  starts->sizes.resize(count);
  starts->constants.resize(count);
  starts->forces.resize(system_.told().size(), count);
  for (Index i = 0; i < count; ++i) {
    const Eigen::VectorXd alone = Eigen::VectorXd::Unit(count, i);
    starts->constants[i] =
        system_.pass().misfit(system_.solve_at_rest([&](int section, double* rows) {
          system_.pass().pose(section, alone, rotation_only, rows);
        }));
    starts->sizes[i] = system_.pass().size() + kLeastSize * area_;
    const Rows forces = system_.forces();
    starts->forces.col(i) = Eigen::Map<const Eigen::VectorXd>(forces.data(), forces.size());
  }
  made = std::move(starts);
  return *made;
}

template <class Real>
Eigen::VectorXd ExampleFit<Real>::guess(const Starts& starts, double at_rest,
                                        const Eigen::VectorXd& handles) const {
  const Eigen::VectorXd along = starts.forces.transpose() * handles;
  Eigen::VectorXd parts(along.size()), shares(along.size());
  double whole = 1 / at_rest;
  for (Index i = 0; i < along.size(); ++i) {
    const double least = kIrrelevant * starts.sizes[i], constant = starts.constants[i];
    parts[i] = std::clamp(along[i] / (constant + least), 0.0, 1.0);
    const double left =
        std::max(0.0, at_rest - 2 * parts[i] * along[i] + parts[i] * parts[i] * constant);
    shares[i] = std::max(0.0, 1 - left / at_rest) / (left + least);
    whole += shares[i];
  }
  return parts.cwiseProduct(shares) / whole;
}

template <class Real>
void ExampleFit<Real>::derive(Eigen::MatrixXd& hessian, Eigen::VectorXd& gradient) {
  followed_.resize(size_t(example_count_));
  for (int i = 0; i < example_count_; ++i)
    followed_[size_t(i)] = system_.solve_at_rest(
        [&](int section, double* rows) { system_.pass().slope(i, section, rows); });
  system_.pass().second_order(followed_, hessian, gradient);
}

template <class Real>
Eigen::VectorXd ExampleFit<Real>::find(const Rows& offsets, bool rotation_only, double stiffness,
                                       const WeightLimits& limits) {
  system_.take_handles(offsets);
  const Starts& at = starts(rotation_only);
  Eigen::VectorXd weights = Eigen::VectorXd::Zero(example_count_);
  const double at_rest = take(weights, rotation_only);
  if (example_count_ == 0 || at_rest == 0) return weights;

  const Rows& told = system_.told();
  const Eigen::Map<const Eigen::VectorXd> handles(told.data(), told.size());
  const Restraint restraint = {stiffness * at.sizes, guess(at, at_rest, handles)};
  const auto try_out = [&](const Eigen::VectorXd& tried) {
    weights = tried;
    return take(weights, rotation_only) + restraint.energy(weights);
  };
  double energy = try_out(limits.within(restraint.guess));

  // Weights are scaled by √D_i, so that damping affects examples of any size alike.
  const Eigen::VectorXd units = at.sizes.cwiseSqrt().cwiseInverse();
  const auto unit = units.asDiagonal();
  // Relative increase of the energy that is put down to rounding.
  const double rounding = sizeof(Real) == sizeof(float) ? 1e-6 : 1e-12;
  double damping = 0;
  Eigen::MatrixXd hessian;
  Eigen::VectorXd gradient;
  for (int step = 0; step < kMostSteps; ++step) {
    derive(hessian, gradient);
    restraint.add_to(hessian, gradient, weights);
    const Eigen::VectorXd from = weights, slope = unit * gradient;
    for (;; damping = std::max(10 * damping, kLeastDamping)) {
      if (damping > kMostDamping) {
        try_out(from);
        return weights;
      }
      Eigen::MatrixXd damped = unit * hessian * unit;
      damped.diagonal().array() += damping;
      const Eigen::LLT<Eigen::MatrixXd> factor(damped);
      if (factor.info() != Eigen::Success) continue;
      const Eigen::VectorXd way =
          limits.any ? limited_step(damped, slope, (limits.least - from).cwiseQuotient(units),
                                    (limits.most - from).cwiseQuotient(units))
                     : Eigen::VectorXd(factor.solve(-slope));
      const double now = try_out(limits.within(from + unit * way));
      const Eigen::VectorXd change = weights - from;
      const double step_size = change.cwiseAbs().maxCoeff();
      if (step_size < (damping < kLeastDamping ? kLastStep : kLastDampedStep)) return weights;
      if (!(now <= energy * (1 + rounding))) continue;
      const double foreseen =
          damping * way.squaredNorm() - 2 * way.dot(slope) - way.dot(damped * way);
      damping *= energy - now > 0.7 * foreseen ? 0.03 : energy - now > 0.3 * foreseen ? 0.3 : 3;
      energy = now;
      break;
    }
  }
  return weights;
}

template <class Real>
double ExampleFit<Real>::bytes() const {
  double bytes = system_.bytes();
  for (const Rows& rows : followed_)
    bytes += static_cast<double>(rows.size() * Index(sizeof(double)));
  for (const auto& starts : starts_)
    if (starts) bytes += static_cast<double>(starts->forces.size() * Index(sizeof(double)));
  return bytes;
}

template class ExampleFit<float>;
template class ExampleFit<double>;

}  // namespace dd
