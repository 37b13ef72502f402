// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "base/harmonic_blend.h"
#include "reconstruction/turned_flux.h"
#include "reconstruction/turning.h"

namespace dd {

/// How the handles move the computed base. The values are those of dd_base_deformer in the public
/// header.
enum class BaseDeformer {
  automatic = 0,  ///< linear up to 135°, motions from 180° on, a mean of both in between
  linear = 1,     ///< the paper's: the smoothest displacement
  motions = 2     ///< see MotionBlend
};

/// Beyond the paper: a linear base blends displacements, collapses where handles turn by half a
/// turn and can't go beyond. Here their rotations are blended, R = R_0 exp(Σ a_h t_h) exp(Σ a_h
/// r_h), and the base is one that turns so:
///
///   B' = λ E + (1 − λ) P + R_0 Σ s_h (W_h C_h − a_h (M_h q − q))
///   P: L P = div(R ∇q), P as the handles have it
///   E = c + R (q − c) + Σ a_h (M_h c − c)
///
/// a_h: harmonic weights. t_h: how far the handle is said to have turned, whole turns among it;
/// r_h: the rotation that is missing to its own, the shortest. c: the mean of the handles' centres
/// by these weights. W_h C_h: what the linear base makes of the handle's motion M_h; s_h = cos²
/// θ_h/2, θ_h its angle, and none beyond half a turn. So a handle that doesn't turn moves the base
/// as the linear one does.
///
/// P is the arc of a bend; but a twist, whose shear it doesn't know, makes it thin. E is right for
/// a twist, and no arc. λ falls from 1 to 0 as the centre of a handle that turns goes sideways by 2
/// to 4 of the handle's own radii.
///
/// Where nothing is fixed all of it is relative to the first handle, R_0 its rotation: what turns
/// all handles turns the result. Exact where all vertices have one rigid motion.
class MotionBlend {
 public:
  explicit MotionBlend(const BoundSurface& bound);

  /// motions: a 3×4 matrix for each handle, in the surface's own unit. turns: 3 a handle, t_h; or
  /// none: all zero. Throws Error(argument) where one is not finite.
  using Affine = Eigen::Matrix<double, 3, 4>;
  void take(const std::vector<Affine>& motions, const std::vector<double>& turns);

  /// How much of it goes into the base, 0 to 1.
  double share(BaseDeformer deformer) const;

  /// Moves the free rows of B', there as the linear base has them, by share towards the blend.
  /// displacement: of all rows, of which the handles' are read.
  void move(const Rows& displacement, double share, Rows& base);

  /// R is its gauge where a handle turns by more than a quarter, and known where the base bends:
  /// that has P's rotations without P.
  Turning turning(BaseDeformer deformer);

  double bytes() const;

 private:
  /// Made when it is first needed: most poses need none of it.
  HarmonicBlend& harmonic();
  void find_rotations();

  const BoundSurface& bound_;
  std::vector<double> radii_;  // of handles, about their centres
  std::unique_ptr<HarmonicBlend> harmonic_;
  std::unique_ptr<TurnedFlux> of_base_, of_surface_;
  Rows solved_, kept_;
  // Of the present pose.
  Eigen::Matrix3d reference_ = Eigen::Matrix3d::Identity();  // R_0, and with it:
  Eigen::Vector3d reference_shift_ = Eigen::Vector3d::Zero();
  /// Of each handle what its weight blends: t, r, the 3×4 matrices s (M − 1)
  /// and M − 1, its centre and 1.
  RowMatrix terms_;
  double about_centres_ = 1;  // λ
  RowMatrix coefficients_;    // s C, as for HandleExtension
  double farthest_ = 0;       // the largest turn between handles, and fixed parts
  double largest_ = 0;        // the largest turn
  Rows rotations_;            // quaternions, in all rows
  bool rotations_found_ = false;
};

}  // namespace dd
