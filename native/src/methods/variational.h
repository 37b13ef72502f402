// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "methods/method.h"

namespace dd {

/// VarMin without multiresolution (§1, Fig. 1b): p' = p + δ, δ the smoothest displacement that the
/// handles allow, L M⁻¹ L δ = 0 on S itself, from the handles' extension. Details shear: it moves
/// them without turning them. With the base's metric on S, δ is the displacement of the base, as it
/// is for a base from outside.
class Variational : public Method {
 public:
  explicit Variational(const BoundSurface& bound) : bound_(bound) {}
  void update(const Frame& frame, const MethodOptions& options) override;
  double bytes() const override { return 0; }

 private:
  const BoundSurface& bound_;
};

}  // namespace dd
