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
constexpr int kMinFreeVerticesForCoarse = 2000;
// Distance of the coarse surface's vertices, as a fraction of √(area of the active triangles).
// Larger is faster, but resolves less of the examples.
constexpr double kCoarseSpacing = 0.03;

}  // namespace

template <class Real>
Examples<Real>::Examples(BoundSurface& bound)
    : bound_(bound),
      joint_motions_(bound),
      fine_(bound, joint_motions_.examples()),
      weights_(Eigen::VectorXd::Zero(Index(bound.examples.size()))),
      reconstruction_(bound) {
  if (bound.region.free_count() < kMinFreeVerticesForCoarse || bound.examples.empty()) return;
  coarse_ = CoarseSurface::make(bound, kCoarseSpacing * bound.active_size);
  if (!coarse_) return;
  std::vector<Positions> examples;
  examples.reserve(fine_.examples.size());
  for (const Positions& example : fine_.examples)
    examples.push_back(example(coarse_->vertices(), kAllIndices));
  coarse_examples_ = std::make_unique<ExampleSurface>(coarse_->surface(), std::move(examples));
}

template <class Real>
void Examples<Real>::update(const Frame& frame, const MethodOptions& options) {
  if (options.example_weights)
    return pose_by_given_weights(*options.example_weights, options, frame.offsets);
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
  const JointRigidMotion joint_motion = joint_motions_.of(offsets, frame.linear, frame.free);
  move_positions(bound_.order().free_count, offsets,
                 [&](const Eigen::RowVector3d& position) { return joint_motion.undo(position); });
  const bool all_whole =
      std::all_of(hold.begin(), hold.end(), [](HandleHold h) { return h == HandleHold::whole; });
  // The coarse surface lacks some vertices of a handle, so their mean can't be prescribed there.
  const bool use_coarse = coarse_ && all_whole;
  if (!fit_ || fit_->hold() != hold) {
    fit_ = nullptr;  // frees its memory first
    fit_ = std::make_unique<ExampleFit<Real>>(use_coarse ? *coarse_examples_ : fine_, hold);
  }
  if (use_coarse) coarse_->restrict(offsets, coarse_offsets_);
  weights_ = fit_->find(use_coarse ? coarse_offsets_ : offsets, options.rotation_only,
                        options.example_stiffness, limits);
  if (!weights_.allFinite())
    throw Error(Status::numeric,
                "No weights of the examples fit the handles: their motion is too large",
                Remedy::move_less);
  const bool refines = options.refined.iterations > 0;
  if (!use_coarse)
    fit_->system().write_pose(weights_, offsets);
  else if (!refines || bound_.outside_base())
    pose_constrained(options, offsets);
  if (refines) refine_towards_handles(options, offsets);
  apply_joint_motion(joint_motion, offsets);
}

template <class Real>
void Examples<Real>::pose_constrained(const MethodOptions& options, Rows& offsets) {
  if (!constrained_) constrained_ = std::make_unique<ExampleSystem<Real>>(fine_, fit_->hold());
  constrained_->prescribe_handles(offsets);
  solve_for_pose(*constrained_, options.rotation_only);
  constrained_->write_pose(weights_, offsets);
}

template <class Real>
void Examples<Real>::pose_unconstrained(bool rotation_only, Rows& offsets) {
  if (!unconstrained_)
    unconstrained_ = std::make_unique<ExampleSystem<Real>>(
        fine_,
        std::vector<HandleHold>(static_cast<size_t>(bound_.region.handle_count), HandleHold::none));
  solve_for_pose(*unconstrained_, rotation_only);
  unconstrained_->write_pose(weights_, offsets);
}

template <class Real>
void Examples<Real>::solve_for_pose(ExampleSystem<Real>& system, bool rotation_only) const {
  system.solve([&](int section, double* rows) {
    system.pass().pose(section, weights_, rotation_only, rows);
  });
}

template <class Real>
void Examples<Real>::refine_towards_handles(const MethodOptions& options, Rows& offsets) {
  Rows posed = Rows::Zero(offsets.rows(), 4);
  pose_unconstrained(options.rotation_only, posed);
  if (!bound_.outside_base()) {
    if (!residual_) residual_ = std::make_unique<HandleResidual>(bound_);
    residual_->extend(posed, offsets);
  }
  reconstruction_.solve_from(posed, options.refined, offsets);
}

template <class Real>
template <class Move>
void Examples<Real>::move_positions(int first, Rows& offsets, const Move& move) const {
  if (joint_motions_.fixed()) return;
  for (int r = first; r < bound_.order().fixed_begin; ++r) {
    const Eigen::RowVector3d rest = bound_.rest.row(r).head<3>();
    offsets.row(r).head<3>() = move(rest + offsets.row(r).head<3>()) - rest;
  }
}

template <class Real>
void Examples<Real>::apply_joint_motion(const JointRigidMotion& joint_motion, Rows& offsets) const {
  move_positions(0, offsets,
                 [&](const Eigen::RowVector3d& position) { return joint_motion.apply(position); });
}

template <class Real>
void Examples<Real>::pose_by_given_weights(const std::vector<double>& weights,
                                           const MethodOptions& options, Rows& offsets) {
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
  pose_unconstrained(options.rotation_only, offsets);
  // JointRigidMotions are blended linearly, by rotation vectors and centres.
  JointRigidMotion joint_motion;
  Eigen::Vector3d rotation = Eigen::Vector3d::Zero();
  for (size_t i = 0; i < weights.size(); ++i) {
    const JointRigidMotion& of_example = joint_motions_.of_examples()[i];
    if (i == 0) joint_motion.from = joint_motion.to = of_example.from;
    rotation += weights[i] * rotation_vector(of_example.rotation);
    joint_motion.to += weights[i] * (of_example.to - of_example.from);
  }
  joint_motion.rotation = rotation_by(rotation);
  apply_joint_motion(joint_motion, offsets);
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
  double bytes = fine_.bytes() + joint_motions_.bytes() + reconstruction_.bytes() +
                 (coarse_ ? coarse_->bytes() + coarse_examples_->bytes() : 0) +
                 (fit_ ? fit_->bytes() : 0);
  for (const auto* system : {constrained_.get(), unconstrained_.get()})
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
