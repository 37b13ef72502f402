// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "methods/method.h"
#include "reconstruction/base_gradients.h"
#include "reconstruction/reconstruction.h"

namespace dd {

/// The paper's method, detail transfer (§6, Fig. 2): applies the base's deformation gradients S_j
/// (15), or their rotations, to S by L p' = div(S_jᵀ) (14). Rotations may be refined.
class Detail : public Method {
 public:
  explicit Detail(BoundSurface& bound);
  void update(const Frame& frame, const MethodOptions& options) override;
  MethodFindings findings() const override;
  bool is_solid(const MethodOptions& options) const override;
  Eigen::VectorXd limbs(const MethodOptions& options) override {
    return reconstruction_.limbs(options.refined);
  }
  void show_limbs(const BasePose& pose, const Turning& turning, const MethodOptions& options,
                  Rows& base) override {
    reconstruction_.show_limbs(options.refined, pose, turning, base);
  }
  double bytes() const override;

 private:
  std::unique_ptr<BaseGradients> gradients_;
  Reconstruction reconstruction_;
};

}  // namespace dd
