// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "base/motion_blend.h"
#include "base/reduced_energy.h"

namespace dd {

/// The rotations of free handles: their matrices prescribe only where a point, the pivot, goes. The
/// handle stays rigid and turns about its pivot so that the surface deforms least: the rotations
/// minimize the as-rigid-as-possible energy of the base (ReducedEnergy), with the other handles'
/// motions and the positions of the pivots given.
///
/// The minimization begins with the rotations of the other handles, interpolated harmonically, and
/// those at the tip of a limb turned on like the end of an arc. Where other handles turn by 180° or
/// more, beyond what blended displacements can follow, the interpolated ones are also the result;
/// from 135° on the two are mixed.
class FreeTurns {
 public:
  using Affine = MotionBlend::Affine;

  /// free: for each handle, whether only its pivot is placed. limbs: as for ReducedEnergy. bound
  /// must outlive this.
  FreeTurns(const BoundSurface& bound, std::vector<char> free, const Eigen::VectorXd& limbs);
  const std::vector<char>& free() const { return free_; }

  /// motions: in the coordinates of bound.mesh; that of a free handle is replaced by the rotation
  /// found, which takes the pivot to the same position. pivots: h×3, at rest. turns: as for
  /// MotionBlend::set_pose(), or empty; the entries of free handles are replaced.
  void find(std::vector<Affine>& motions, const Positions& pivots,
            std::vector<double>& turns) const;

  /// The same for a base from outside: each free handle takes the rotation that fits the base's
  /// deformation around the handle best. base: B', in order().
  void follow(const Rows& base, std::vector<Affine>& motions, const Positions& pivots) const;

  double bytes() const;

 private:
  struct HandleGroup;
  struct Interpolated;
  void find_groups();
  void find_harmonic_weights();
  void add_to_hold(int handle, int column, const Rows& weights);
  Eigen::Matrix3d turned_like_an_arc(size_t free_index, const Eigen::Matrix3d& rotation,
                                     const std::vector<Affine>& motions,
                                     const Eigen::Vector3d& pivot) const;
  Interpolated interpolate(const std::vector<Affine>& motions, const Positions& pivots,
                           const std::vector<double>& turns) const;
  void interpolate(const HandleGroup& group, const std::vector<Affine>& motions,
                   const Positions& pivots, const std::vector<double>& turns,
                   Interpolated& result) const;

  const BoundSurface& bound_;
  std::vector<char> free_;
  ReducedEnergy energy_;
  // The handles that share components of the mesh. Groups don't affect one another.
  struct HandleGroup {
    std::vector<int> prescribed;  // handles that aren't free
    std::vector<int> free;        // indices into ReducedEnergy::free_handles()
    bool fixed = false;           // whether the components have a fixed vertex
  };
  std::vector<HandleGroup> groups_;
  RowMatrix harmonic_weights_;  // f×h: harmonic weights of the other handles at each free handle
  /// What holds a free handle, of each other handle and of what is fixed: the rims that its
  /// harmonic weights flow to, weighted by the flux.
  struct Hold {
    double weight = 0, squares = 0;  // squares: Σ w |p|²
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  };
  std::vector<std::vector<Hold>> holds_;  // f×(h + 1), what is fixed comes last
};

}  // namespace dd
