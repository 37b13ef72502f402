// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "methods/method.h"

namespace dd {

/// VarMin without multiresolution (§1, Fig. 1b): p' = p + δ, with δ the smoothest displacement that
/// takes on the handles' motions, K δ = 0 with K on S. Details shear, because they are moved
/// without being rotated. With BaseMetric::surface δ is the displacement of the base. For a base
/// from outside it is that of the given base, too.
class Variational : public Method {
 public:
  explicit Variational(const BoundSurface& bound) : bound_(bound) {}
  void update(const Frame& frame, const MethodOptions& options) override;
  double bytes() const override { return 0; }

 private:
  const BoundSurface& bound_;
};

}  // namespace dd
