// SPDX-License-Identifier: GPL-3.0-or-later
#include "surface/reconstruction.h"

#include <algorithm>

namespace dd {

void Reconstruction::solve(const GradientSource& gradients, Formulation formulation,
                           Rows& offsets) {
  if (formulation == Formulation::surface) {
    surface_.poisson->solve(
        gradients.at_rest(), [&](int section, double* rows) { gradients.add(section, rows); },
        offsets);
    return;
  }
  const FourthPointWeights weights = formulation == Formulation::fourth_points
                                         ? FourthPointWeights::volumes
                                         : FourthPointWeights::ones;
  // Made before the present one is let go: it may be refused.
  if (!fourth_points_ || fourth_points_->weights() != weights)
    fourth_points_ = std::make_unique<FourthPoints>(surface_.mesh, surface_.region,
                                                    surface_.faces_with_free_corners(), weights);
  fourth_points_->solve(gradients, surface_.order(), offsets);
}

void Reconstruction::solve_unrefined(const GradientSource& rotations, ClampedPoisson* clamps,
                                     double held, Rows& offsets) {
  const auto add = [&](int section, double* rows) { rotations.add(section, rows); };
  if (clamps && held == 1) {
    clamps->solve(rotations.at_rest(), add, offsets);
    return;
  }
  solve(rotations, Formulation::surface, offsets);
  if (!clamps || held == 0) return;
  const Rows creased = offsets;
  clamps->step(rotations.at_rest(), add, offsets);
  offsets = creased + held * (offsets - creased);
}

void Reconstruction::solve(const GradientSource& rotations, const Refined& refined,
                           const Turning& turning, Rows& offsets) {
  ClampedPoisson* const clamps = clamped(refined.rim_smoothing);
  // The last iteration holds the slope at rims; so does what that leaves of the unrefined result.
  const double held =
      refined.iterations == 0 ? 1 : std::min({1.0, 5 * turning.share, 5 * (1 - turning.share)});
  if (turning.known_share < 1) solve_unrefined(rotations, clamps, held, offsets);
  if (turning.known_share > 0) {
    const Rows by_base = offsets;
    solve_unrefined(*turning.known, clamps, held, offsets);
    offsets = by_base + turning.known_share * (offsets - by_base);
  }
  if (refined.iterations == 0 || turning.share == 0) return;
  const double length = refined.rotation_smoothing * surface_.active_size;
  if (!refinement_ || refinement_->length() != length)
    refinement_ = make_refinement(surface_, length);
  refinement_->run(refined.iterations, clamps, turning, offsets);
}

ClampedPoisson* Reconstruction::clamped(double rim_smoothing) {
  if (rim_smoothing == 0) return nullptr;
  const double length = rim_smoothing * surface_.active_size;
  if (clamped_ && clamped_->length() == length) return clamped_.get();
  clamped_ = std::make_unique<ClampedPoisson>(surface_.mesh, surface_.region, surface_.operators,
                                              *surface_.poisson, *surface_.dissection, length);
  return clamped_.get();
}

double Reconstruction::bytes() const {
  return (fourth_points_ ? fourth_points_->bytes() : 0) + (clamped_ ? clamped_->bytes() : 0) +
         (refinement_ ? refinement_->bytes() : 0);
}

}  // namespace dd
