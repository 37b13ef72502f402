// SPDX-License-Identifier: GPL-3.0-or-later
#include "reconstruction/limb_base.h"

#include <algorithm>

namespace dd {

namespace {

// Smoothing length as a fraction of a limb's radius. Of waves around a circle the first, which is
// the circle, keeps 97% with it, the second three quarters and the ninth 2%.
constexpr double kLengthOfRadius = 0.35;
// Least radius, as a fraction of the largest one. Safety: bounds how far the system's entries
// differ.
constexpr double kLeastShownRadius = 1e-3;

// Least weight of a vertex' own centre, beside the share of its section. Safety: the system is
// regular where no vertex has a section.
constexpr double kLeastShare = 1e-3;

/// Masses with which RotationSmoothing takes a length times factors at the active vertices.
Eigen::VectorXd masses_for(const FactoredSurface& surface, const Eigen::VectorXd& factors) {
  Eigen::VectorXd masses = surface.operators.masses;
  for (Index i = 0; i < factors.size(); ++i)
    masses[surface.poisson->active_vertex(static_cast<int>(i))] /= factors[i] * factors[i];
  return masses;
}

/// 3 S² − 2 S³ of values by active index, S = (M + tL)⁻¹ M, t the squared length. With x the
/// squared ratio of length and wave, S = 1 / (1 + x), long waves lose 3 x² only. relative: the
/// length at each active vertex, as a fraction.
Rows smoothed(const FactoredSurface& surface, double length, const Eigen::VectorXd& relative,
              Rows values) {
  RotationSmoothing smoothing(surface, length, masses_for(surface, relative));
  smoothing.run(values.data());
  smoothing.run(values.data());
  const Rows twice = values;
  smoothing.run(values.data());
  return 3 * twice - 2 * values;
}

}  // namespace

LimbBase::LimbBase(const FactoredSurface& surface, const CrossSections& sections,
                   const Positions& base, double solidity)
    : surface_(surface),
      sections_(sections),
      arms_(Positions::Zero(surface.order().free_count, 3)),
      shares_(Eigen::VectorXd::Zero(surface.order().free_count)) {
  if (sections.empty()) return;
  const Index count = sections.shares.size();
  Rows values = Rows::Zero(count, 4);
  values.col(0) = sections.arms.rowwise().norm();
  values.col(1) = sections.shares;
  // Between bumps, single vertices may have no section. An arm is the radius in the proportion of
  // the share.
  const double mean = values.col(0).sum() / values.col(1).sum();
  values = smoothed(surface, kLengthOfRadius * mean, Eigen::VectorXd::Ones(count), values);
  const Eigen::VectorXd shares = values.col(1).cwiseMax(0).cwiseMin(1);
  Eigen::VectorXd radii = Eigen::VectorXd::Zero(count);
  for (Index i = 0; i < count; ++i)
    if (shares[i] > 0) radii[i] = std::max(0.0, values(i, 0)) / shares[i];
  const double largest = radii.maxCoeff();
  for (Index i = 0; i < count; ++i)
    values.row(i).head<3>() =
        surface.mesh.positions.row(surface.poisson->active_vertex(static_cast<int>(i)));
  const Eigen::VectorXd relative = (radii / largest).cwiseMax(kLeastShownRadius);
  const Rows shown = smoothed(surface, kLengthOfRadius * largest, relative, values);
  along_ = std::make_unique<RotationSmoothing>(
      surface, kLengthOfRadius * largest,
      masses_for(surface,
                 relative.cwiseQuotient(sections.shares.cwiseMax(kLeastShare).cwiseSqrt())));
  const Rows centres = this->centres(in_order(base, surface.order()));
  for (Index i = 0; i < arms_.rows(); ++i) arms_.row(i) = (shown.row(i) - centres.row(i)).head<3>();
  shares_ = solidity * shares.head(arms_.rows());
}

Rows LimbBase::centres(const Rows& base) const {
  Rows now = Rows::Zero(sections_.shares.size(), 4);
  for (Index i = 0; i < now.rows(); ++i)
    now.row(i) = base.row(surface_.poisson->active_row(static_cast<int>(i)));
  sections_.average(now, arms_.rows());  // rims stay
  if (along_) along_->run(now.data());
  return now;
}

Rows LimbBase::offsets(const LimbBend& bend, const Rows& base, const Rows& even) const {
  Rows added = centres(base);
  surface_.poisson->pool().parallel_for(added.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      if (i >= arms_.rows() || shares_[i] == 0) {
        added.row(i).setZero();
        continue;
      }
      added.row(i).head<3>() +=
          (bend.rotation(base, even, i) * arms_.row(i).transpose()).transpose();
      added.row(i) = shares_[i] * (added.row(i) - base.row(i));
    }
  });
  return added;
}

}  // namespace dd
