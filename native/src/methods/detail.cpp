// SPDX-License-Identifier: GPL-3.0-or-later
#include "methods/detail.h"

namespace dd {

Detail::Detail(BoundSurface& bound)
    : gradients_(make_base_gradients(bound, bound.base)), reconstruction_(bound, &bound.base) {}

void Detail::update(const Frame& frame, const MethodOptions& options) {
  const BasePose pose{frame.base, frame.linear};
  if (options.rotation_only && options.formulation == Formulation::surface) {
    reconstruction_.solve(*gradients_, options.refined, pose, frame.turning, frame.offsets);
    return;
  }
  gradients_->take(pose, options.rotation_only);
  reconstruction_.solve(*gradients_, options.formulation, frame.offsets);
}

MethodFindings Detail::findings() const {
  MethodFindings findings;
  findings.stand_in_count = gradients_->stand_in_count();
  findings.coarse_vertex_count = reconstruction_.coarse_vertex_count();
  return findings;
}

double Detail::bytes() const { return gradients_->bytes() + reconstruction_.bytes(); }

}  // namespace dd
