// SPDX-License-Identifier: GPL-3.0-or-later
#include "reconstruction/reconstruction.h"

#include <algorithm>
#include <future>
#include <utility>

#include "support/run_async.h"

namespace dd {

void Reconstruction::solve(const GradientSource& gradients, Formulation formulation,
                           Rows& offsets) {
  if (formulation == Formulation::surface) {
    solve_by(gradients, nullptr, 0, offsets);
    return;
  }
  const FourthPointWeights weights = formulation == Formulation::fourth_points
                                         ? FourthPointWeights::volumes
                                         : FourthPointWeights::ones;
  // Made before the present one is released, since the constructor may throw.
  if (!fourth_points_ || fourth_points_->weights() != weights)
    fourth_points_ = std::make_unique<FourthPointSystem>(
        surface_.mesh, surface_.region, surface_.faces_with_free_corners(), weights);
  fourth_points_->solve(gradients, surface_.order(), offsets);
}

void Reconstruction::solve_by(const FluxSource& source, RimClamps* clamps, double clamp_weight,
                              Rows& offsets) {
  if (clamps) {
    clamps->solve(source, clamp_weight, offsets);
    return;
  }
  surface_.poisson->solve(
      source.at_rest(), [&](int section, double* rows) { source.add(section, rows); }, offsets);
}

void Reconstruction::solve_unrefined(BaseGradients& gradients, const BasePose& pose,
                                     const Turning& turning, RimClamps* clamps, double clamp_weight,
                                     Rows& offsets) {
  const auto solve = [&](const FluxSource& source) {
    solve_by(source, clamps, clamp_weight, offsets);
  };
  const auto by_base = [&] {
    gradients.take(pose, true);
    solve(gradients);
  };
  turning.solve(by_base, solve, offsets);
}

RimClamps* Reconstruction::prepare(const Refined& refined, bool is_refined) {
  const double length = refined.rotation_smoothing * surface_.active_size;
  std::future<void> refinement;
  if (is_refined && refined_length_ != length)
    refinement = run_async(surface_.poisson->pool().count(), [&] {
      prepare_refinement(length);
      refinement_of(refined.solidity);
    });
  RimClamps* const clamps = this->clamps(refined.rim_smoothing);
  if (refinement.valid()) refinement.get();
  return clamps;
}

void Reconstruction::prepare_refinement(double length) {
  std::unique_ptr<CoarseRefinement> coarse;
  if (base_) coarse = CoarseRefinement::make(surface_, *base_, length);
  std::unique_ptr<Refinement> whole =
      coarse ? nullptr : make_refinement(surface_, base_, length, surface_.operators.masses, true);
  coarse_refinement_ = std::move(coarse);
  refinement_ = std::move(whole);
  refined_length_ = length;
}

const RefinedFlux& Reconstruction::refinement_of(double solidity) {
  if (coarse_refinement_) {
    coarse_refinement_->set_solidity(solidity);
    return *coarse_refinement_;
  }
  if (solidity > 0 && !cross_sections_) cross_sections_ = find_cross_sections(surface_);
  refinement_->set_solidity(cross_sections_.get(), solidity);
  return *refinement_;
}

void Reconstruction::solve(BaseGradients& gradients, const Refined& refined, const BasePose& pose,
                           const Turning& turning, Rows& offsets) {
  const double weight = turning.refinement_weight;
  bool is_refined = refined.iterations > 0 && (weight > 0 || refined.solidity > 0);
  RimClamps* const clamps = prepare(refined, is_refined);
  const RefinedFlux* const refinement = is_refined ? &refinement_of(refined.solidity) : nullptr;
  is_refined = is_refined && (weight > 0 || refinement->solidity().size() > 0);
  // The last solve of a refinement clamps the rims. Where the unrefined result is mixed in, it is
  // clamped as well, with a weight that falls to 0 as the share approaches 0 or 1.
  const double clamp_weight =
      refined.iterations == 0 ? 1 : std::min({1.0, 5 * weight, 5 * (1 - weight)});
  if (!is_refined) {
    solve_unrefined(gradients, pose, turning, clamps, clamp_weight, offsets);
    return;
  }
  const bool mixed = weight < 1;
  if (mixed || refinement_)
    solve_unrefined(gradients, pose, turning, clamps, clamp_weight, offsets);
  Rows unrefined;
  if (mixed) unrefined = offsets;
  if (coarse_refinement_) {
    coarse_refinement_->find(refined.iterations, pose, turning, offsets);
    refinement->arms().solve_anew_for_centres(offsets,
                                              [&] { solve_by(*refinement, clamps, 1, offsets); });
  } else {
    refinement_->find(refined.iterations, pose.base, turning, offsets);
    solve_refined(clamps, offsets);
  }
  if (mixed) mix(unrefined, weight, refinement->solidity(), offsets);
}

void Reconstruction::mix(const Rows& unrefined, double weight, const Eigen::VectorXd& solidity,
                         Rows& offsets) {
  if (solidity.size() == 0) {
    offsets = unrefined + weight * (offsets - unrefined);
    return;
  }
  for (Index r = 0; r < solidity.size(); ++r)
    offsets.row(r) = unrefined.row(r) +
                     (weight + solidity[r] * (1 - weight)) * (offsets.row(r) - unrefined.row(r));
}

void Reconstruction::show_limbs(const Refined& refined, const BasePose& pose,
                                const Turning& turning, Rows& base) {
  prepare(refined, true);
  refinement_of(refined.solidity);
  const Rows offsets = coarse_refinement_ ? coarse_refinement_->limb_base(pose, turning)
                                          : refinement_->limb_base(pose.base, turning);
  if (offsets.rows() > 0)
    base.topRows(surface_.order().free_count) += offsets.topRows(surface_.order().free_count);
}

Eigen::VectorXd Reconstruction::limbs(const Refined& refined) {
  prepare(refined, true);
  const Eigen::VectorXd& solidity = refinement_of(refined.solidity).solidity();
  if (solidity.size() == 0) return {};
  Eigen::VectorXd found = Eigen::VectorXd::Zero(surface_.mesh.vertex_count());
  for (Index row = 0; row < solidity.size(); ++row)
    found[surface_.order().vertex_of_row[size_t(row)]] = solidity[row] / refined.solidity;
  return found;
}

void Reconstruction::solve_from(const Rows& posed, const Refined& refined, Rows& offsets) {
  RimClamps* const clamps = prepare(refined, true);
  refinement_of(refined.solidity);
  refinement_->find_from(posed, std::max(1, refined.iterations), offsets);
  solve_refined(clamps, offsets);
}

void Reconstruction::solve_refined(RimClamps* clamps, Rows& offsets) {
  refinement_->arms().solve_for_centres(offsets, [&] {
    if (clamps)
      clamps->step(*refinement_, offsets);
    else
      solve_by(*refinement_, nullptr, 0, offsets);
  });
}

RimClamps* Reconstruction::clamps(double rim_smoothing) {
  if (rim_smoothing == 0) return nullptr;
  const double length = rim_smoothing * surface_.active_size;
  if (!clamps_ || clamps_->length() != length) clamps_ = make_rim_clamps(surface_, length);
  return clamps_.get();
}

double Reconstruction::bytes() const {
  return (fourth_points_ ? fourth_points_->bytes() : 0) + (clamps_ ? clamps_->bytes() : 0) +
         (refinement_ ? refinement_->bytes() : 0) +
         (cross_sections_ ? cross_sections_->bytes() : 0) +
         (coarse_refinement_ ? coarse_refinement_->bytes() : 0);
}

}  // namespace dd
