// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "base/bound_surface.h"
#include "reconstruction/harmonic_blend.h"
#include "reconstruction/rotated_flux.h"
#include "reconstruction/turning.h"

namespace dd {

/// How the handles move the computed base. The values are those of dd_base_deformer in the public
/// header.
enum class BaseDeformer {
  automatic = 0,  ///< linear up to 135°, motions from 180° on, a mean of both in between
  linear = 1,     ///< the paper's: δq with K δq = 0
  motions = 2     ///< see MotionBlend
};

/// A base for large rotations, beyond the paper. The linear base blends displacements: it collapses
/// when handles turn by 180° and can't go beyond. This one blends the handles' rotations
/// harmonically, R = R_0 exp(Σ a_h t_h) exp(Σ a_h r_h), and makes the base of them:
///
///   B' = λ E + (1 − λ) P + R_0 Σ s_h (W_h C_h − a_h (M_h q − q))
///   P: L P = div(R ∇q), with the handles' vertices at their deformed positions
///   E = c + R (q − c) + Σ a_h (M_h c − c)
///
/// q: a point of B. a_h: harmonic weight of handle h there. M_h: the handle's motion. t_h: rotation
/// vector that the caller gives for the handle, including whole turns; r_h: the shortest rotation
/// vector from there to the handle's actual rotation. c: the mean of the handles' centres, weighted
/// by a_h. The last sum is what the linear base adds to the handles' motions blended by a_h, in so
/// far as handles don't turn: W_h C_h is the displacement by the linear base, of which the fraction
/// s_h = cos²(θ_h/2) is kept, θ_h the handle's angle, none from 180° on. So a handle that doesn't
/// turn moves the base as the linear one does.
///
/// P bends a limb along an arc, but a twist thins it, because R lacks the shear of a twist. E keeps
/// a twisted limb's cross-sections, but doesn't bend along an arc. λ falls from 1 to 0 as the
/// centre of a turning handle moves perpendicular to its axis by 2 to 4 times the handle's RMS
/// radius.
///
/// R_0 is the identity if vertices are fixed. Else it is the rotation of the first handle, and all
/// motions above are relative to that handle's, so a rigid motion of all handles moves the result
/// alike. A rigid motion of all constrained vertices is reproduced exactly.
class MotionBlend {
 public:
  explicit MotionBlend(const BoundSurface& bound);

  /// Sets the pose. motions: the affine matrix of each handle, in the coordinates of bound.mesh.
  /// turns: t_h, three numbers for each handle; empty: all zero. Throws Error(argument) if one is
  /// not finite.
  using Affine = Eigen::Matrix<double, 3, 4>;
  void set_pose(const std::vector<Affine>& motions, const std::vector<double>& turns);

  /// The fraction of the blend in the base, in [0, 1]; the rest is the linear base.
  double blend_fraction(BaseDeformer deformer) const;

  /// Moves the free rows of base from the linear base towards the blend by the given fraction.
  /// displacement: all rows; only those of handles are read.
  void blend_into(const Rows& displacement, double fraction, Rows& base);

  /// How the reconstruction of the surface uses R. If a handle turns by more than 90°, R is the
  /// gauge of its rotations: it tells those apart that differ by whole turns. For λ < 1 R also
  /// replaces the rotations of the gradients of B', as P of a long tube is too thin in the middle
  /// for its gradients to show how it bends. The refinement's weight falls where handles turn by
  /// more than 135°.
  Turning turning(BaseDeformer deformer);

  double bytes() const;

 private:
  /// Computed on first use, as most poses don't need it.
  HarmonicBlend& harmonic();
  void blend_rotations();

  const BoundSurface& bound_;
  std::vector<double> radii_;  // of each handle: RMS distance of its vertices from its centre
  std::unique_ptr<HarmonicBlend> harmonic_;
  std::unique_ptr<RotatedFlux> of_base_, of_surface_;
  Rows solved_, kept_displacement_;
  // The current pose.
  Eigen::Matrix3d reference_ = Eigen::Matrix3d::Identity();  // R_0, and its translation:
  Eigen::Vector3d reference_shift_ = Eigen::Vector3d::Zero();
  HandleTurns turns_;
  /// What else is interpolated by the harmonic weights, a row for each handle: s (M − 1), M − 1,
  /// the centre and 1, where M is relative to the reference and M − 1 is a 3×4 matrix, row by row.
  /// The interpolated 1 is the sum of the weights, by which the centre is divided.
  RowMatrix handle_terms_;
  double twist_fraction_ = 1;  // λ
  RowMatrix coefficients_;     // s C, for HandleExtension::displace()
  /// The largest angle between two handles, or a handle and fixed parts.
  double largest_relative_angle_ = 0;
  double largest_angle_ = 0;  // largest |t| + |r| of a handle, plus the reference's |t|
  Rows rotations_;            // R as quaternions, all rows
  bool rotations_blended_ = false;
};

}  // namespace dd
