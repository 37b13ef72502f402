// SPDX-License-Identifier: GPL-3.0-or-later
#include "methods/examples/examples.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <string>

#include "support/rotations.h"

namespace dd {

namespace {

constexpr double kToGuess = 1e-2;     // κ
constexpr double kBeyond = 3;         // μ
constexpr double kLeastSize = 1e-9;   // of the surface's area: what D_i is at least
constexpr double kIrrelevant = 1e-6;  // of D_i: what handles tell of an example at least
constexpr int kMostSteps = 10;
constexpr double kLastStep = 1e-3;  // Newton's error after such a step is far smaller
constexpr double kLeastDamping = 1e-4, kMostDamping = 1e6;

/// How far a weight is out of 0 to 1, with its sign.
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
  /// Half its derivatives.
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
Examples<Real>::Examples(BoundSurface& bound)
    : bound_(bound),
      stances_(bound),
      turns_(bound, stances_.examples()),
      reconstruction_(bound) {
  weights_ = Eigen::VectorXd::Zero(Index(bound.examples.size()));
}

template <class Real>
void Examples<Real>::update(const Frame& frame, const MethodOptions& options) {
  if (options.example_weights) return show(*options.example_weights, options, frame.offsets);
  std::vector<HandleHold> hold(static_cast<size_t>(bound_.region.handle_count), HandleHold::whole);
  for (size_t h = 0; h < frame.free.size(); ++h)
    if (frame.free[h]) hold[h] = HandleHold::mean;
  make(fitted_, std::move(hold));
  const Stance stance = stances_.of(frame.offsets, frame.linear, frame.free);
  if (!stances_.fixed()) {
    const RowOrder& order = bound_.order();
    for (int r = order.free_count; r < order.fixed_begin; ++r) {
      const Eigen::RowVector3d rest = bound_.rest.row(r).head<3>();
      frame.offsets.row(r).head<3>() =
          stance.take_back(rest + frame.offsets.row(r).head<3>()) - rest;
    }
  }
  fitted_->take_handles(frame.offsets);
  fit(options);
  if (!weights_.allFinite())
    throw Error(Status::numeric,
                "No weights of the examples fit the handles: their motion is too large.");
  fitted_->give(weights_, frame.offsets);
  if (options.refined.iterations > 0) go_beyond(options, frame.offsets);
  stand(stance, frame.offsets);
}

template <class Real>
void Examples<Real>::stand(const Stance& stance, Rows& offsets) const {
  if (stances_.fixed()) return;
  for (int r = 0; r < bound_.order().fixed_begin; ++r) {
    const Eigen::RowVector3d rest = bound_.rest.row(r).head<3>();
    offsets.row(r).head<3>() = stance.put(rest + offsets.row(r).head<3>()) - rest;
  }
}

template <class Real>
void Examples<Real>::go_beyond(const MethodOptions& options, Rows& offsets) {
  Rows posed = Rows::Zero(offsets.rows(), 4);
  let_go(options.rotation_only, posed);
  if (!bound_.outside_base()) {
    if (!residual_) residual_ = std::make_unique<HandleResidual>(bound_);
    residual_->spread(posed, offsets);
  }
  reconstruction_.solve_from(posed, options.refined, offsets);
}

template <class Real>
void Examples<Real>::show(const std::vector<double>& weights, const MethodOptions& options,
                          Rows& offsets) {
  if (weights.size() != bound_.examples.size())
    throw Error(Status::argument, "There are " + std::to_string(weights.size()) +
                                      " example weights, but " +
                                      std::to_string(bound_.examples.size()) + " examples.");
  const Eigen::Map<const Eigen::VectorXd> given(weights.data(), Index(weights.size()));
  for (Index i = 0; i < given.size(); ++i)
    if (!std::isfinite(given[i]))
      throw Error(Status::argument,
                  "The weight of example " + std::to_string(i) + " is not finite.");
  weights_ = given;
  let_go(options.rotation_only, offsets);
  // Stances are mixed as their turns and their centres are.
  Stance stance;
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();
  for (size_t i = 0; i < weights.size(); ++i) {
    const Stance& of_example = stances_.of_examples()[i];
    if (i == 0) stance.from = stance.to = of_example.from;
    turn += weights[i] * rotation_vector(of_example.turn);
    stance.to += weights[i] * (of_example.to - of_example.from);
  }
  stance.turn = rotation_by(turn);
  stand(stance, offsets);
}

template <class Real>
void Examples<Real>::let_go(bool rotation_only, Rows& offsets) {
  make(let_go_,
       std::vector<HandleHold>(static_cast<size_t>(bound_.region.handle_count), HandleHold::none));
  let_go_->solve([&](int section, double* rows) {
    let_go_->pass().pose(section, weights_, rotation_only, rows);
  });
  let_go_->give(weights_, offsets);
}

template <class Real>
void Examples<Real>::make(std::unique_ptr<ExampleSystem<Real>>& system,
                          std::vector<HandleHold> hold) {
  if (system && system->hold() == hold) return;
  if (&system == &fitted_)
    for (auto& starts : starts_) starts = nullptr;
  system = nullptr;  // before its memory is needed again
  system = std::make_unique<ExampleSystem<Real>>(bound_, stances_.examples(), turns_, std::move(hold));
}

template <class Real>
double Examples<Real>::take(const Eigen::VectorXd& weights, bool rotation_only) {
  return fitted_->pass().misfit(fitted_->solve([&](int section, double* rows) {
    fitted_->pass().pose(section, weights, rotation_only, rows);
  }));
}

template <class Real>
const typename Examples<Real>::Starts& Examples<Real>::starts(bool rotation_only) {
  std::unique_ptr<Starts>& made = starts_[rotation_only];
  if (made) return *made;
  const Index count = weights_.size();
  auto starts = std::make_unique<Starts>();
  starts->sizes.resize(count);
  starts->constants.resize(count);
  starts->forces.resize(fitted_->told().size(), count);
  for (Index i = 0; i < count; ++i) {
    const Eigen::VectorXd alone = Eigen::VectorXd::Unit(count, i);
    starts->constants[i] =
        fitted_->pass().misfit(fitted_->solve_at_rest([&](int section, double* rows) {
          fitted_->pass().pose(section, alone, rotation_only, rows);
        }));
    starts->sizes[i] = fitted_->pass().size() + kLeastSize * bound_.operators.metric.areas.sum();
    const Rows forces = fitted_->forces();
    starts->forces.col(i) = Eigen::Map<const Eigen::VectorXd>(forces.data(), forces.size());
  }
  made = std::move(starts);
  return *made;
}

template <class Real>
Eigen::VectorXd Examples<Real>::guess(const Starts& starts, double at_rest,
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
void Examples<Real>::derive(Eigen::MatrixXd& hessian, Eigen::VectorXd& gradient) {
  for (int i = 0; i < weights_.size(); ++i)
    fitted_->pass().project(i, fitted_->solve_at_rest([&](int section, double* rows) {
      fitted_->pass().slope(i, section, rows);
    }));
  fitted_->pass().second_order(hessian, gradient);
}

template <class Real>
void Examples<Real>::fit(const MethodOptions& options) {
  const Index count = weights_.size();
  const Starts& at = starts(options.rotation_only);
  weights_.setZero();
  const double at_rest = take(weights_, options.rotation_only);
  if (count == 0 || at_rest == 0) return;

  const Rows& told = fitted_->told();
  const Eigen::Map<const Eigen::VectorXd> handles(told.data(), told.size());
  const Restraint restraint = {options.example_stiffness * at.sizes, guess(at, at_rest, handles)};
  const auto try_out = [&](const Eigen::VectorXd& weights) {
    weights_ = weights;
    return take(weights_, options.rotation_only) + restraint.energy(weights_);
  };
  double energy = try_out(restraint.guess);

  // In units in which all examples are of one size.
  const auto unit = at.sizes.cwiseSqrt().cwiseInverse().asDiagonal();
  // What rounding may add to an energy that falls.
  const double rounding = sizeof(Real) == sizeof(float) ? 1e-6 : 1e-12;
  double damping = 0;
  Eigen::MatrixXd hessian;
  Eigen::VectorXd gradient;
  for (int step = 0; step < kMostSteps; ++step) {
    derive(hessian, gradient);
    restraint.add_to(hessian, gradient, weights_);
    const Eigen::VectorXd from = weights_, slope = unit * gradient;
    for (;; damping = std::max(10 * damping, kLeastDamping)) {
      if (damping > kMostDamping) {
        try_out(from);
        return;
      }
      Eigen::MatrixXd damped = unit * hessian * unit;
      damped.diagonal().array() += damping;
      const Eigen::LLT<Eigen::MatrixXd> factor(damped);
      if (factor.info() != Eigen::Success) continue;
      const Eigen::VectorXd way = factor.solve(-slope), change = unit * way;
      const double now = try_out(from + change);
      if (change.cwiseAbs().maxCoeff() < kLastStep) return;
      if (!(now <= energy * (1 + rounding))) continue;
      const double foreseen = damping * way.squaredNorm() - way.dot(slope);
      damping *= energy - now > 0.7 * foreseen ? 0.03 : energy - now > 0.3 * foreseen ? 0.3 : 3;
      energy = now;
      break;
    }
  }
}

template <class Real>
MethodFindings Examples<Real>::findings() const {
  if (!weights_.allFinite())
    throw Error(Status::numeric,
                "The last update by examples failed, so there are no weights: its handles' "
                "matrices were too large.");
  MethodFindings findings;
  findings.example_weights.assign(weights_.begin(), weights_.end());
  return findings;
}

template <class Real>
double Examples<Real>::bytes() const {
  double bytes = turns_.bytes() + reconstruction_.bytes();
  for (const auto& starts : starts_)
    if (starts) bytes += static_cast<double>(starts->forces.size() * Index(sizeof(double)));
  for (const auto* system : {fitted_.get(), let_go_.get()})
    if (system) bytes += system->bytes();
  return bytes;
}

template class Examples<float>;
template class Examples<double>;

std::unique_ptr<Method> make_examples(BoundSurface& bound) {
  if (bound.poisson->precision() == Precision::single)
    return std::make_unique<Examples<float>>(bound);
  return std::make_unique<Examples<double>>(bound);
}

}  // namespace dd
