// SPDX-License-Identifier: GPL-3.0-or-later
#include "surface/reconstruction.h"

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
                                                    surface_.poisson->active().triangles, weights);
  fourth_points_->solve(gradients, surface_.order(), offsets);
}

void Reconstruction::refine(int iterations, Rows& offsets) {
  if (iterations == 0) return;
  if (!refinement_) refinement_ = make_refinement(surface_);
  refinement_->run(iterations, offsets);
}

double Reconstruction::bytes() const {
  return (fourth_points_ ? fourth_points_->bytes() : 0) + (refinement_ ? refinement_->bytes() : 0);
}

}  // namespace dd
