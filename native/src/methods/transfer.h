// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "../gradients.h"
#include "../refinement.h"
#include "../volumetric_transfer.h"
#include "method.h"

namespace dd {

/// The paper's method (§6, Fig. 2): the base's deformation gradients S_j (15), or their rotations,
/// are carried over to S by L p' = div(S_jᵀ) (14), and refined if asked.
class Transfer : public Method {
 public:
  explicit Transfer(BoundSurface& bound);
  void update(const Frame& frame, const MethodOptions& options) override;
  double bytes() const override;

  /// Triangles whose base has no area: they turn with a neighbour or with their handle.
  int borrowed_count() const { return borrowed_count_; }

 private:
  /// A triangle of a part whose whole base is a point or a line, held by a single handle: that
  /// handle's matrix is its S_j. Held by several, or by one vertex, it has none to go by: S_j = I.
  struct Carried {
    int handle;  // -1: S_j = I
    int target[3];
    Eigen::Matrix3d flux;  // a corner a column
  };
  void update_volumetrically(const Frame& frame, const MethodOptions& options);
  void carry(const std::vector<int>& triangles, const Positions& flux);
  void add_carried(const Frame& frame, bool rotation_only, double* right_hand_side) const;

  BoundSurface& bound_;
  GradientPass pass_;
  std::vector<Carried> carried_;
  int borrowed_count_ = 0;
  std::unique_ptr<Refinement> refinement_;
  std::unique_ptr<VolumetricTransfer> volumetric_;
  Formulation volumetric_as_ = Formulation::surface;
};

}  // namespace dd
