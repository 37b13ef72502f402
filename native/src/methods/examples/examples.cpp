// SPDX-License-Identifier: GPL-3.0-or-later
#include "methods/examples/examples.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <string>

namespace dd {

namespace {

constexpr double kToGuess = 1e-3;     // κ
constexpr double kBeyond = 0.3;       // μ
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
Examples<Real>::LetGo::LetGo(const BoundSurface& bound, const ExampleTurns& turns) {
  std::vector<int> roles = bound.region.role;
  for (int& role : roles) role = role == kFixed ? kFixed : kFree;
  region = split_region(bound.mesh, roles, 0, MovedBy::base);
  SparseMatrix block = free_block(bound.operators.laplacian, region);
  const Dissection dissection = free_dissection(block, region, bound.mesh.positions);
  BlockOptions options;
  options.dissection = &dissection;
  options.pool = &bound.poisson->pool();
  options.precision = bound.poisson->precision();
  poisson = std::make_unique<PoissonSystem>(bound.mesh, region, bound.operators, std::move(block),
                                            options);
  pass = std::make_unique<ExamplePass<Real>>(bound, turns, *poisson);
  places = std::make_unique<ExamplePlaces>(bound, region, poisson->order());
  offsets = Rows::Zero(poisson->order().count(), 4);
}

template <class Real>
Examples<Real>::Examples(BoundSurface& bound)
    : bound_(bound),
      turns_(bound),
      pass_(bound, turns_, *bound.poisson),
      places_(bound, bound.region, bound.order()),
      nothing_(Rows::Zero(bound.poisson->right_hand_side_rows(), 4)),
      follow_(Rows::Zero(bound.order().count(), 4)) {
  weights_ = Eigen::VectorXd::Zero(pass_.example_count());
}

template <class Real>
void Examples<Real>::update(const Frame& frame, const MethodOptions& options) {
  if (options.example_weights) return show(*options.example_weights, options, frame.offsets);
  fit(options, frame.offsets);
  if (!weights_.allFinite())
    throw Error(Status::numeric,
                "No weights of the examples fit the handles: their motion is too large.");
  places_.place(weights_, frame.offsets);
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
  if (!let_go_) let_go_ = std::make_unique<LetGo>(bound_, turns_);
  LetGo& free = *let_go_;
  free.poisson->solve(
      Rows::Zero(free.poisson->right_hand_side_rows(), 4),
      [&](int section, double* rows) {
        free.pass->pose(section, weights_, options.rotation_only, rows);
      },
      free.offsets);
  free.places->place(weights_, free.offsets);
  const RowOrder& order = bound_.order();
  for (int r = 0; r < order.fixed_begin; ++r)
    offsets.row(r) = free.offsets.row(free.poisson->order().row_of_vertex[order.vertex_of_row[r]]);
}

template <class Real>
double Examples<Real>::take(const Eigen::VectorXd& weights, bool rotation_only, Rows& offsets) {
  bound_.poisson->solve(
      nothing_,
      [&](int section, double* rows) { pass_.pose(section, weights, rotation_only, rows); },
      offsets);
  return pass_.misfit(offsets);
}

template <class Real>
const typename Examples<Real>::Starts& Examples<Real>::starts(bool rotation_only) {
  std::unique_ptr<Starts>& made = starts_[rotation_only];
  if (made) return *made;
  const RowOrder& order = bound_.order();
  const Index count = pass_.example_count();
  const int held = order.fixed_begin - order.free_count;
  auto starts = std::make_unique<Starts>();
  starts->sizes.resize(count);
  starts->constants.resize(count);
  starts->forces.resize(4 * Index(held), count);
  for (Index i = 0; i < count; ++i) {
    starts->constants[i] = take(Eigen::VectorXd::Unit(count, i), rotation_only, follow_);
    starts->sizes[i] = pass_.size() + kLeastSize * bound_.operators.metric.areas.sum();
    const Rows forces = pass_.misfit_divergence(order.count()).middleRows(order.free_count, held);
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
  for (int i = 0; i < pass_.example_count(); ++i) {
    bound_.poisson->solve(
        nothing_, [&](int section, double* rows) { pass_.slope(i, section, rows); }, follow_);
    pass_.project(i, follow_);
  }
  pass_.second_order(hessian, gradient);
}

template <class Real>
void Examples<Real>::fit(const MethodOptions& options, Rows& offsets) {
  const Index count = pass_.example_count();
  const Starts& at = starts(options.rotation_only);
  weights_.setZero();
  const double at_rest = take(weights_, options.rotation_only, offsets);
  if (count == 0 || at_rest == 0) return;

  const RowOrder& order = bound_.order();
  const Eigen::Map<const Eigen::VectorXd> handles(offsets.data() + 4 * Index(order.free_count),
                                                  4 * Index(order.fixed_begin - order.free_count));
  const Restraint restraint = {options.example_stiffness * at.sizes, guess(at, at_rest, handles)};
  const auto try_out = [&](const Eigen::VectorXd& weights) {
    weights_ = weights;
    return take(weights_, options.rotation_only, offsets) + restraint.energy(weights_);
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
  double bytes = turns_.bytes() + pass_.bytes() +
                 static_cast<double>((nothing_.size() + follow_.size()) * Index(sizeof(double)));
  for (const auto& starts : starts_)
    if (starts) bytes += static_cast<double>(starts->forces.size() * Index(sizeof(double)));
  if (let_go_)
    bytes += let_go_->poisson->bytes() + let_go_->pass->bytes() +
             static_cast<double>(let_go_->offsets.size() * Index(sizeof(double)));
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
