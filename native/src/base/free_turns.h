// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "base/bound_surface.h"
#include "base/motion_blend.h"

namespace dd {

/// The rotations of free handles: their matrices prescribe only where a point, the pivot, goes. The
/// handle stays rigid and turns about its pivot so that the surface deforms least.
///
/// The rotations minimize the as-rigid-as-possible energy of the base,
///
///   E(A, R) = Σ_k Σ_{j∈k} A_j ‖G_j(q + W C) − G_j(q) R_kᵀ‖²
///
/// over the linear parts A of the free handles, with all other entries of C given, and one rotation
/// R_k for each cluster k of triangles: up to 64 clusters of the surface and one around each free
/// handle. This is the reduced energy of Jacobson and others 2012 (Fast automatic skinning
/// transformations) in the subspace of the basis functions W, minimized by local and global steps.
/// A step costs the clusters' rotations and products with small matrices, independent of the mesh's
/// size. The initial rotations interpolate those of the other handles harmonically. Where other
/// handles turn by 180° or more, beyond what blended displacements can follow, these are also the
/// result; from 135° on the two are mixed.
class FreeTurns {
 public:
  using Affine = MotionBlend::Affine;

  /// free: for each handle, whether only its pivot is placed. bound must outlive this.
  FreeTurns(const BoundSurface& bound, std::vector<char> free);
  const std::vector<char>& free() const { return free_; }

  /// motions: in the coordinates of bound.mesh; that of a free handle is replaced by the rotation
  /// found, with the pivot taken to the same place. pivots: h×3, at rest. turns: as for
  /// MotionBlend::take(), or empty; the entries of free handles are replaced.
  void find(std::vector<Affine>& motions, const Positions& pivots,
            std::vector<double>& turns) const;

  /// The same for a base from outside: each free handle takes the rotation that fits the base's
  /// deformation around the handle best. base: B', in order().
  void follow(const Rows& base, std::vector<Affine>& motions, const Positions& pivots) const;

  double bytes() const;

 private:
  struct Part;
  struct Spread;
  std::vector<int> cluster_triangles(int& count) const;
  void gather(const std::vector<int>& cluster, int count);
  void find_parts();
  Spread spread(const std::vector<Affine>& motions, const Positions& pivots,
                const std::vector<double>& turns) const;
  void spread(const Part& part, const std::vector<Affine>& motions, const Positions& pivots,
              const std::vector<double>& turns, Spread& result) const;

  const BoundSurface& bound_;
  std::vector<char> free_;
  std::vector<int> handles_;  // the free handles
  // The handles that share components of the mesh. Parts don't affect one another.
  struct Part {
    std::vector<int> turning, free;  // handles that aren't free; indices into handles_
    bool fixed = false;              // whether the part has a fixed vertex
  };
  std::vector<Part> parts_;
  RowMatrix weights_;  // f×h: harmonic weights of the other handles at each free handle
  RowMatrix energy_;   // the rows of Wᵀ L W for coordinates of free handles
  RowMatrix pull_;     // three rows for each cluster, Σ_j div(G_j) W: covariance per coordinate
  RowMatrix at_rest_;  // three rows for each cluster, Σ_j div(G_j) q: covariance at rest
  struct Corner {
    int row;  // in order()
    Eigen::Vector3d flux;
  };
  std::vector<std::vector<Corner>> around_;  // vertices of the cluster around each free handle
};

}  // namespace dd
