// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "methods/method.h"
#include "surface/gradients.h"
#include "surface/refinement.h"
#include "surface/volumetric_transfer.h"

namespace dd {

/// What others ask of transfer in whichever precision.
class TransferMethod : public Method {
 public:
  /// Triangles whose base has no area: they turn with a neighbour or with their handle.
  int borrowed_count() const { return borrowed_count_; }

 protected:
  int borrowed_count_ = 0;
};

/// The method in the precision of the Poisson system.
std::unique_ptr<TransferMethod> make_transfer(BoundSurface& bound);

/// The paper's method (§6, Fig. 2): the base's deformation gradients S_j (15), or their rotations,
/// are carried over to S by L p' = div(S_jᵀ) (14), and refined if asked.
template <class Real>
class Transfer : public TransferMethod {
 public:
  explicit Transfer(BoundSurface& bound);
  void update(const Frame& frame, const MethodOptions& options) override;
  double bytes() const override;

 private:
  /// A triangle of a part whose whole base is a point or a line, held by a single handle: that
  /// handle's matrix is its S_j. Held by several, or by one vertex, it has none to go by: S_j = I.
  struct Carried {
    int handle;  // -1: S_j = I
    int part;    // of the Poisson system
    int target[3];
    Eigen::Matrix3d flux;  // a corner a column
  };
  void update_volumetrically(const Frame& frame, const MethodOptions& options);
  void carry(const std::vector<int>& triangles, const Positions& flux);
  std::vector<Eigen::Matrix3d> carrying_gradients(const Frame& frame, bool rotation_only) const;
  void add(int part, const Rows& base, bool rotation_only,
           const std::vector<Eigen::Matrix3d>& carrying, double* right_hand_side) const;
  /// What add() gives where nothing moves, to rounding in this precision.
  Rows at_rest(bool rotation_only) const;

  BoundSurface& bound_;
  std::unique_ptr<GradientPass<Real>> pass_;
  std::vector<Carried> carried_;
  Rows at_rest_[2];  // whole gradients, rotations
  std::unique_ptr<Refinement<Real>> refinement_;
  std::unique_ptr<VolumetricTransfer> volumetric_;
  Formulation volumetric_as_ = Formulation::surface;
};

}  // namespace dd
