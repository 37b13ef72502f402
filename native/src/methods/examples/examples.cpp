// SPDX-License-Identifier: GPL-3.0-or-later
#include "methods/examples/examples.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "support/rotations.h"

namespace dd {

namespace {

// Number of free vertices from which weights are fitted on a coarse surface: with fewer the fit on
// S is quick.
constexpr int kFewest = 2000;
// Distance of the coarse surface's vertices, as a fraction of √(area of the active triangles).
// Larger is faster, but resolves less of the examples.
constexpr double kSpacing = 0.03;

}  // namespace

template <class Real>
Examples<Real>::Examples(BoundSurface& bound)
    : bound_(bound),
      stances_(bound),
      fine_(bound, stances_.examples()),
      weights_(Eigen::VectorXd::Zero(Index(bound.examples.size()))),
      reconstruction_(bound) {
  if (bound.region.free_count() < kFewest || bound.examples.empty()) return;
  coarse_ = CoarseSurface::make(bound, kSpacing * bound.active_size);
  if (!coarse_) return;
  std::vector<Positions> examples;
  examples.reserve(fine_.examples.size());
  for (const Positions& example : fine_.examples)
    examples.push_back(example(coarse_->vertices(), kAllIndices));
  coarse_examples_ = std::make_unique<ExampleSurface>(coarse_->surface(), std::move(examples));
}

template <class Real>
void Examples<Real>::update(const Frame& frame, const MethodOptions& options) {
  if (options.example_weights) return show(*options.example_weights, options, frame.offsets);
  const size_t limited = options.example_limits.size() / 2;
  if (limited != 0 && limited != bound_.examples.size())
    throw Error(Status::argument,
                "There are limits of " + std::to_string(limited) + " examples, but " +
                    std::to_string(bound_.examples.size()) + " examples",
                Remedy::call);
  const WeightLimits limits(options.example_limits, Index(bound_.examples.size()));
  std::vector<HandleHold> hold(static_cast<size_t>(bound_.region.handle_count), HandleHold::whole);
  for (size_t h = 0; h < frame.free.size(); ++h)
    if (frame.free[h]) hold[h] = HandleHold::mean;
  Rows& offsets = frame.offsets;
  const Stance stance = stances_.of(offsets, frame.linear, frame.free);
  replace(bound_.order().free_count, offsets,
          [&](const Eigen::RowVector3d& place) { return stance.take_back(place); });
  const bool all_whole =
      std::all_of(hold.begin(), hold.end(), [](HandleHold h) { return h == HandleHold::whole; });
  // The coarse surface lacks some vertices of a handle, so their mean can't be prescribed there.
  const bool coarsely = coarse_ && all_whole;
  if (!fit_ || fit_->hold() != hold) {
    fit_ = nullptr;  // frees its memory first
    fit_ = std::make_unique<ExampleFit<Real>>(coarsely ? *coarse_examples_ : fine_, hold);
  }
  if (coarsely) coarse_->restrict(offsets, coarse_offsets_);
  weights_ = fit_->find(coarsely ? coarse_offsets_ : offsets, options.rotation_only,
                        options.example_stiffness, limits);
  if (!weights_.allFinite())
    throw Error(Status::numeric,
                "No weights of the examples fit the handles: their motion is too large",
                Remedy::move_less);
  const bool beyond = options.refined.iterations > 0;
  if (!coarsely)
    fit_->system().give(weights_, offsets);
  else if (!beyond || bound_.outside_base())
    hold_pose(options, offsets);
  if (beyond) go_beyond(options, offsets);
  stand(stance, offsets);
}

template <class Real>
void Examples<Real>::hold_pose(const MethodOptions& options, Rows& offsets) {
  if (!held_) held_ = std::make_unique<ExampleSystem<Real>>(fine_, fit_->hold());
  held_->take_handles(offsets);
  solve_for_pose(*held_, options.rotation_only);
  held_->give(weights_, offsets);
}

template <class Real>
void Examples<Real>::let_go(bool rotation_only, Rows& offsets) {
  if (!let_go_)
    let_go_ = std::make_unique<ExampleSystem<Real>>(
        fine_,
        std::vector<HandleHold>(static_cast<size_t>(bound_.region.handle_count), HandleHold::none));
  solve_for_pose(*let_go_, rotation_only);
  let_go_->give(weights_, offsets);
}

template <class Real>
void Examples<Real>::solve_for_pose(ExampleSystem<Real>& system, bool rotation_only) const {
  system.solve([&](int section, double* rows) {
    system.pass().pose(section, weights_, rotation_only, rows);
  });
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
template <class Move>
void Examples<Real>::replace(int first, Rows& offsets, const Move& move) const {
  if (stances_.fixed()) return;
  for (int r = first; r < bound_.order().fixed_begin; ++r) {
    const Eigen::RowVector3d rest = bound_.rest.row(r).head<3>();
    offsets.row(r).head<3>() = move(rest + offsets.row(r).head<3>()) - rest;
  }
}

template <class Real>
void Examples<Real>::stand(const Stance& stance, Rows& offsets) const {
  replace(0, offsets, [&](const Eigen::RowVector3d& place) { return stance.put(place); });
}

template <class Real>
void Examples<Real>::show(const std::vector<double>& weights, const MethodOptions& options,
                          Rows& offsets) {
  if (weights.size() != bound_.examples.size())
    throw Error(Status::argument,
                "There are " + std::to_string(weights.size()) + " example weights, but " +
                    std::to_string(bound_.examples.size()) + " examples",
                Remedy::call);
  const Eigen::Map<const Eigen::VectorXd> given(weights.data(), Index(weights.size()));
  for (Index i = 0; i < given.size(); ++i)
    if (!std::isfinite(given[i]))
      throw Error(Status::argument, {Subject::example, i}, "has a weight that is not finite",
                  Remedy::call);
  weights_ = given;
  let_go(options.rotation_only, offsets);
  // Stances are blended linearly, by rotation vectors and centres.
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
MethodFindings Examples<Real>::findings() const {
  if (!weights_.allFinite())
    throw Error(Status::numeric,
                "The last update by examples failed, so there are no weights: its handles' "
                "matrices were too large",
                Remedy::move_less);
  MethodFindings findings;
  findings.example_weights.assign(weights_.begin(), weights_.end());
  return findings;
}

template <class Real>
double Examples<Real>::bytes() const {
  double bytes = fine_.bytes() + stances_.bytes() + reconstruction_.bytes() +
                 (coarse_ ? coarse_->bytes() + coarse_examples_->bytes() : 0) +
                 (fit_ ? fit_->bytes() : 0);
  for (const auto* system : {held_.get(), let_go_.get()})
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
