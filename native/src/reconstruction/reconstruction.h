// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "reconstruction/base_gradients.h"
#include "reconstruction/coarse/coarse_refinement.h"
#include "reconstruction/fourth_points.h"
#include "reconstruction/refinement.h"
#include "systems/clamped_poisson.h"

namespace dd {

/// How a surface is made of deformation gradients. The values are those of dd_formulation in the
/// public header.
enum class Formulation {
  surface = 0,                  ///< (14), §5: n unknowns
  fourth_points = 1,            ///< (10), §3, weighted by volumes: n + m unknowns
  fourth_points_unweighted = 2  ///< (10) as it stands
};

/// What goes beyond (14). Lengths are shares of FactoredSurface::active_size.
struct Refined {
  int iterations = 0;
  double rotation_smoothing = 0.009;  ///< see RotationSmoothing
  double rim_smoothing = 0;           ///< see ClampedPoisson; 0: (14) as it stands
};

/// A surface made of deformation gradients: by (14) on its factor, or by (10), and refined if
/// asked. What a formulation needs beside the factor is made when it is first asked for.
class Reconstruction {
 public:
  /// surface must outlive it. base: B at rest, n×3, which must, too; null: only solve_from()
  /// refines.
  explicit Reconstruction(FactoredSurface& surface, const Positions* base = nullptr)
      : surface_(surface), base_(base) {}

  /// offsets: the displacement of all rows, in: those of handles, out: those of the free vertices.
  /// Components that nothing holds come out with one vertex at rest.
  void solve(const GradientSource& gradients, Formulation formulation, Rows& offsets);

  /// By (14) of rotations, and the result improved by rotations alone. gradients: of that base, to
  /// take the pose if it is needed.
  void solve(BaseGradients& gradients, const Refined& refined, const BasePose& pose,
             const Turning& turning, Rows& offsets);

  /// By (14) of a pose of S in place of S, whose gradients turn as its rotations do on the way to
  /// where the handles are: what they ask for beyond the pose. posed: the displacement of all rows.
  /// offsets: of all rows, from where it starts. At least one iteration. Not where a base was
  /// given, as that may be refined on a coarse surface.
  void solve_from(const Rows& posed, const Refined& refined, Rows& offsets);

  /// Of the surface on which the last refinement found its rotations; 0: of this one.
  int coarse_vertex_count() const {
    return coarse_refinement_ ? coarse_refinement_->vertex_count() : 0;
  }
  double bytes() const;

 private:
  /// What such an update needs, both halves beside each other. Returns clamped().
  ClampedPoisson* prepare(const Refined& refined, bool is_refined);
  ClampedPoisson* clamped(double rim_smoothing);
  /// Makes the one that serves for such a length.
  void prepare_refinement(double length);
  /// held: how much of the slope at rims is.
  void solve_unrefined(BaseGradients& gradients, const BasePose& pose, const Turning& turning,
                       ClampedPoisson* clamps, double held, Rows& offsets);
  void solve_by(const FluxSource& source, ClampedPoisson* clamps, double held, Rows& offsets);
  /// The last solve, with the rotations that were found on the surface itself.
  void solve_refined(ClampedPoisson* clamps, double relaxation, Rows& offsets);

  FactoredSurface& surface_;
  const Positions* base_;
  std::unique_ptr<FourthPoints> fourth_points_;
  std::unique_ptr<ClampedPoisson> clamped_;
  double refined_length_ = 0;  // of one of these:
  std::unique_ptr<Refinement> refinement_;
  std::unique_ptr<CoarseRefinement> coarse_refinement_;
};

}  // namespace dd
