// SPDX-License-Identifier: GPL-3.0-or-later
#include "reconstruction/coarse/coarse_refinement.h"

#include <algorithm>
#include <map>
#include <utility>
#include <vector>

#include "reconstruction/coarse/coarse_surface.h"
#include "reconstruction/fold_limits.h"
#include "reconstruction/rotated_flux.h"
#include "reconstruction/rotated_flux_pass.h"
#include "reconstruction/rotation_means.h"

namespace dd {

namespace {

// Free vertices, below which refinement on the surface itself is fast enough.
constexpr int kMinFreeVertices = 10000;
// Spacing of coarse vertices as a fraction of the smoothing length: a field that smooth needs no
// more of them.
constexpr double kSpacingOfLength = 0.9;

/// Masses for the smoothing on the coarse surface. Interpolation between coarse vertices smooths as
/// well, over a length² of about 1/5 of the area per vertex. So the squared smoothing length is
/// reduced by 0.15 of the area that a coarse vertex has more than on the fine surface, by at most a
/// half.
///
/// Tuned: with 0.2 the survey's deformations are nearest to those without a coarse surface, but a
/// twisted bar of 97,000 vertices folds after 8 iterations. With 0.15 none does, and they agree
/// within 0.2% of the box.
Eigen::VectorXd masses_on(const CoarseSurface& coarse, const FactoredSurface& fine, double length) {
  const double square = length * length;
  Eigen::VectorXd masses = coarse.surface().operators.masses;
  for (Index v = 0; v < masses.size(); ++v) {
    const double more = masses[v] - fine.operators.masses[coarse.vertices()[size_t(v)]];
    masses[v] *= square / std::clamp(square - 0.15 * more, 0.5 * square, square);
  }
  return masses;
}

/// The sections of a coarse surface's vertices.
std::unique_ptr<CrossSections> cross_sections_of(
    const CoarseSurface& coarse, const FactoredSurface& fine,
    const std::vector<CoarseSurface::Stencil>& stencils) {
  const FactoredSurface& surface = coarse.surface();
  CrossSectionSamples samples{
      fine, coarse.with_surroundings(fine), surface, {}, [&](int active_index) {
        return stencils[size_t(active_index)].active_index[0];
      }};
  for (int i = 0; i < surface.poisson->active_vertex_count(); ++i)
    samples.vertices.push_back(coarse.vertices()[size_t(surface.poisson->active_vertex(i))]);
  return find_cross_sections(samples);
}

template <class Real>
class CoarseRefinementOf : public CoarseRefinement {
 public:
  CoarseRefinementOf(FactoredSurface& surface, const Positions& base,
                     std::unique_ptr<CoarseSurface> coarse, double length)
      : fine_(surface),
        surface_(std::move(coarse)),
        base_(base(surface_->vertices(), kAllIndices)),
        gradients_(make_base_gradients(surface_->surface(), base_)),
        refinement_(make_refinement(surface_->surface(), &base_, length,
                                    masses_on(*surface_, surface, length), false)),
        pass_(
            surface, surface.mesh.positions,
            [&](int v) { return surface.poisson->active_index(surface.order().row_of_vertex[v]); }),
        stencils_(surface_->stencils(surface)),
        arms_(surface),
        limits_(surface) {
    typename RotationMeans<Real>::Terms terms;
    for (const CoarseSurface::Stencil& stencil : stencils_) {
      terms.clear();
      for (int k = 0; k < 3; ++k)
        if (stencil.weight[k] > 0) terms.emplace_back(stencil.active_index[k], stencil.weight[k]);
      spread_.append(terms);
    }
    spread_.close();
    rotations_.resize(4 * spread_.size());
  }

  void find(int iterations, const BasePose& pose, const Turning& turning,
            const Rows& offsets) override {
    const bool smooths_all = solidity_of_row_.size() > 0 || surface_->surface().stiffness.varies();
    const double smoothing = smooths_all ? 1 : last_smoothing(iterations);
    if (rests_.count(smoothing) == 0) {
      // The right-hand side at rest, whose rotations are I up to rounding.
      const std::vector<Eigen::Matrix3d> still(pose.linear.size(), Eigen::Matrix3d::Identity());
      const Rows rest = in_order(base_, surface_->surface().order());
      offsets_ = Rows::Zero(rest.rows(), 4);
      find_from(iterations, {rest, still}, {});
      rests_.emplace(smoothing, pass_.all(rotations_.data()));
    }
    at_rest_ = &rests_.at(smoothing);
    surface_->restrict(pose.base, posed_);
    surface_->restrict(offsets, offsets_);
    Turning here = turning;
    if (turning.gauge) {
      surface_->restrict(*turning.gauge, gauge_);
      here.gauge = &gauge_;
    }
    if (turning.prescribed_weight > 0) {
      surface_->restrict(*turning.prescribed_rotations, prescribed_rotations_);
      if (!prescribed_)
        prescribed_ = std::make_unique<RotatedFlux>(
            surface_->surface(), surface_->surface().mesh.positions, prescribed_rotations_);
      here.prescribed = prescribed_.get();
    }
    find_from(iterations, {posed_, pose.linear}, here);
  }

  Rows limb_base(const BasePose& pose, const Turning& turning) override {
    surface_->restrict(pose.base, posed_);
    const Rows coarse = refinement_->limb_base(posed_, turning);
    Rows fine = Rows::Zero(coarse.rows() > 0 ? fine_.poisson->active_vertex_count() : 0, 4);
    for (Index i = 0; i < fine.rows(); ++i)
      for (int k = 0; k < 3; ++k)
        fine.row(i) +=
            stencils_[size_t(i)].weight[k] * coarse.row(stencils_[size_t(i)].active_index[k]);
    return fine;
  }

  void set_solidity(double solidity) override {
    if (solidity == solidity_) return;
    if (solidity > 0 && !cross_sections_)
      cross_sections_ = cross_sections_of(*surface_, fine_, stencils_);
    solidity_ = -1;  // not set if memory runs out
    refinement_->set_solidity(cross_sections_.get(), solidity);
    Positions arms(0, 3);
    solidity_of_row_.resize(0);
    if (solidity > 0 && !cross_sections_->empty()) {
      arms.setZero(fine_.poisson->active_vertex_count(), 3);
      solidity_of_row_.setZero(fine_.order().free_count);
      for (Index i = 0; i < arms.rows(); ++i)
        for (int k = 0; k < 3; ++k) {
          const int from = stencils_[size_t(i)].active_index[k];
          const double weight = solidity * stencils_[size_t(i)].weight[k];
          arms.row(i) += weight * cross_sections_->arms.row(from);
          if (i < solidity_of_row_.size())
            solidity_of_row_[i] += weight * cross_sections_->shares[from];
        }
    }
    const bool had_arms = !arms_.empty();
    arms_.set(arms);
    if (had_arms || !arms_.empty()) pass_.take(arms_.centres(fine_.rest));
    limits_.take(fine_.rest, arms_);
    rests_.clear();
    solidity_ = solidity;
  }
  const CrossSectionArms& arms() const override { return arms_; }
  const Eigen::VectorXd& solidity() const override { return solidity_of_row_; }

  void add(int section, double* rows) const override {
    pass_.add(rotations_.data(), section, rows);
    limits_.add(rotations_.data(), arms_, section, rows);
  }
  const Rows& at_rest() const override { return *at_rest_; }

  int vertex_count() const override { return surface_->surface().mesh.vertex_count(); }
  double bytes() const override {
    const auto doubles = base_.size() + posed_.size() + offsets_.size() + gauge_.size() +
                         prescribed_rotations_.size() +
                         Index(rests_.size()) * 4 * fine_.poisson->right_hand_side_rows();
    return surface_->bytes() + gradients_->bytes() + refinement_->bytes() + pass_.bytes() +
           spread_.bytes() + arms_.bytes() + limits_.bytes() +
           (cross_sections_ ? cross_sections_->bytes() : 0) +
           static_cast<double>(stencils_.size() * sizeof(stencils_[0])) +
           (prescribed_ ? prescribed_->bytes() : 0) +
           static_cast<double>((given_.size() + rotations_.size()) * sizeof(Real)) +
           static_cast<double>(doubles) * sizeof(double);
  }

 private:
  /// Finds rotations_ for a pose of the coarse surface; offsets_ must hold the handles' rows.
  void find_from(int iterations, const BasePose& pose, const Turning& turning) {
    const auto by_base = [&] {
      gradients_->take(pose, true);
      start(*gradients_);
    };
    turning.solve(by_base, [&](const FluxSource& source) { start(source); }, offsets_);
    refinement_->find(iterations, pose.base, turning, offsets_);
    const Rows found = refinement_->rotations();
    given_.assign(found.data(), found.data() + found.size());
    spread_.run(given_, rotations_, fine_.poisson->pool());
    arms_.turn(rotations_.data());
  }

  void start(const FluxSource& source) {
    surface_->surface().poisson->solve(
        source.at_rest(), [&](int section, double* rows) { source.add(section, rows); }, offsets_);
  }

  FactoredSurface& fine_;
  std::unique_ptr<CoarseSurface> surface_;
  Positions base_;  // B at rest, of the coarse surface
  std::unique_ptr<BaseGradients> gradients_;
  std::unique_ptr<Refinement> refinement_;
  RotatedFluxPass<Real> pass_;  // on the fine surface
  RotationMeans<Real> spread_;  // interpolation from the coarse active vertices to the fine ones
  std::vector<Real> given_, rotations_;
  std::vector<CoarseSurface::Stencil> stencils_;   // of the fine active vertices
  std::unique_ptr<CrossSections> cross_sections_;  // of the coarse surface; null: not needed so far
  double solidity_ = -1;                           // below 0: not set
  CrossSectionArms arms_;                          // of the fine surface
  FoldLimits<Real> limits_;                        // of the fine surface
  Eigen::VectorXd solidity_of_row_;                // of the fine surface
  std::map<double, Rows> rests_;                   // right-hand sides at rest, by last_smoothing()
  const Rows* at_rest_ = nullptr;                  // one of rests_
  // Of the current pose, rows in the coarse surface's order.
  Rows posed_, offsets_, gauge_, prescribed_rotations_;
  std::unique_ptr<RotatedFlux> prescribed_;
};

}  // namespace

double coarse_spacing(double length, double active_size) {
  return std::min(kSpacingOfLength * length, kMaxSpacing * active_size);
}

std::unique_ptr<CoarseRefinement> CoarseRefinement::make(FactoredSurface& surface,
                                                         const Positions& base, double length) {
  if (surface.region.free_count() < kMinFreeVertices) return nullptr;
  std::unique_ptr<CoarseSurface> coarse =
      CoarseSurface::make(surface, coarse_spacing(length, surface.active_size));
  if (!coarse) return nullptr;
  if (surface.poisson->precision() == Precision::single)
    return std::make_unique<CoarseRefinementOf<float>>(surface, base, std::move(coarse), length);
  return std::make_unique<CoarseRefinementOf<double>>(surface, base, std::move(coarse), length);
}

}  // namespace dd
