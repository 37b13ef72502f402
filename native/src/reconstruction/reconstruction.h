// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "reconstruction/base_gradients.h"
#include "reconstruction/coarse/coarse_refinement.h"
#include "reconstruction/fourth_points.h"
#include "reconstruction/refinement.h"
#include "reconstruction/rim_clamps.h"

namespace dd {

/// The system that reconstructs a surface from deformation gradients. The values are those of
/// dd_formulation in the public header.
enum class Formulation {
  surface = 0,                  ///< (14), §5: n unknowns
  fourth_points = 1,            ///< (10), §3, weighted by volumes: n + m unknowns
  fourth_points_unweighted = 2  ///< (10) as it stands
};

/// Options beyond (14). Lengths are fractions of FactoredSurface::active_size.
struct Refined {
  int iterations = 0;
  /// See RotationSmoothing. Tuned on the survey's cases: .005 and less fold on dense meshes, .012
  /// and more are stiffer.
  double rotation_smoothing = 0.009;
  double rim_smoothing = 0;  ///< see ClampedPoisson; 0: (14) as it stands
  /// Of limbs, with iterations: 0, a hollow skin as (14) has it, to 1; see CrossSections.
  double solidity = 0;
};

/// Reconstructs a surface from deformation gradients, by (14) or by (10), and refines it if asked.
/// Systems other than the Poisson factor are built on first use.
class Reconstruction {
 public:
  /// surface, and base if given, must outlive this. base: B at rest, n×3; null: only solve_from()
  /// can refine.
  explicit Reconstruction(FactoredSurface& surface, const Positions* base = nullptr)
      : surface_(surface), base_(base) {}

  /// offsets: displacements of all rows; in: those of handles, out: those of free vertices. The
  /// ground vertex of a component without constrained vertices stays at rest.
  void solve(const GradientSource& gradients, Formulation formulation, Rows& offsets);

  /// (14) with the rotations of the base, then refinement. gradients: of the base that was given to
  /// the constructor; its take() is called if they are needed.
  void solve(BaseGradients& gradients, const Refined& refined, const BasePose& pose,
             const Turning& turning, Rows& offsets);

  /// Refinement with a pose of S in place of S, for handles that ask for more than the pose: the
  /// pose's gradients are rotated by the smoothed rotations from the pose to S'. posed:
  /// displacements of all rows. offsets: of all rows, in: the start. Runs at least one iteration.
  /// Only where no base was given, since with one the refinement may be on a coarse surface.
  void solve_from(const Rows& posed, const Refined& refined, Rows& offsets);

  /// Adds to B', where limbs are solid, what LimbBase does. base: rows in the surface's order,
  /// positions or displacements.
  void show_limbs(const Refined& refined, const BasePose& pose, const Turning& turning, Rows& base);

  /// How far each vertex is part of a limb, 0 to 1: see CrossSections. Empty: none is. refined:
  /// with iterations and solidity.
  Eigen::VectorXd limbs(const Refined& refined);

  /// Vertices of the coarse surface of the last refinement; 0: it was on the surface itself.
  int coarse_vertex_count() const {
    return coarse_refinement_ ? coarse_refinement_->vertex_count() : 0;
  }
  double bytes() const;

 private:
  /// Builds the refinement and the clamps that an update needs, concurrently. Returns clamps().
  RimClamps* prepare(const Refined& refined, bool is_refined);
  RimClamps* clamps(double rim_smoothing);
  /// Makes the refinement for this length, on a coarse surface where that pays.
  void prepare_refinement(double length);
  /// clamp_weight: weight of the solution with clamped rims against that of (14), 0 to 1.
  void solve_unrefined(BaseGradients& gradients, const BasePose& pose, const Turning& turning,
                       RimClamps* clamps, double clamp_weight, Rows& offsets);
  void solve_by(const FluxSource& source, RimClamps* clamps, double clamp_weight, Rows& offsets);
  /// Sets the solidity of the refinement that exists, and returns it.
  const RefinedFlux& refinement_of(double solidity);
  /// The last solve, with the rotations of refinement_.
  void solve_refined(RimClamps* clamps, Rows& offsets);
  /// Goes from the unrefined result to the refined one.
  static void mix(const Rows& unrefined, double weight, const Eigen::VectorXd& solidity,
                  Rows& offsets);

  FactoredSurface& surface_;
  const Positions* base_;
  std::unique_ptr<FourthPointSystem> fourth_points_;
  std::unique_ptr<RimClamps> clamps_;
  double refined_length_ = -1;  // smoothing length of the one that exists:
  std::unique_ptr<Refinement> refinement_;
  std::unique_ptr<CoarseRefinement> coarse_refinement_;
  std::unique_ptr<CrossSections>
      cross_sections_;  // of surface_, for refinement_; null: not needed so far
};

}  // namespace dd
