// SPDX-License-Identifier: GPL-3.0-or-later
#include "methods/detail.h"

namespace dd {

Detail::Detail(BoundSurface& bound)
    : gradients_(make_base_gradients(bound, bound.base)), reconstruction_(bound, &bound.base) {}

namespace {

bool may_refine(const MethodOptions& options) {
  return options.rotation_only && options.formulation == Formulation::surface;
}

}  // namespace

bool Detail::is_solid(const MethodOptions& options) const {
  return may_refine(options) && options.refined.iterations > 0 && options.refined.solidity > 0;
}

void Detail::update(const Frame& frame, const MethodOptions& options) {
  const BasePose pose{frame.base, frame.linear};
  if (may_refine(options)) {
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
