// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "base/bound_surface.h"
#include "base/motion_blend.h"

namespace dd {

/// The rotations of handles that only place: each takes a point of its own, the pivot, where it is
/// told, keeps its shape, and turns about it as the surface around it asks.
///
/// What asks is the energy that the rotations of a detail-preserving surface leave,
///
///   E(A, R) = Σ_k Σ_{j∈k} A_j ‖G_j(q + W C) − G_j(q) R_kᵀ‖²
///
/// over the linear parts A of these handles, all other numbers of C given, and a rotation R_k for
/// each of some 70 clusters of triangles: the reduced energy of Jacobson and others 2012 (Fast
/// automatic skinning transformations), on the functions W that move the base anyway. A step takes
/// no more than those rotations and a product with small matrices, whatever the mesh's
/// size. The steps begin at what the other handles' rotations, spread harmonically, give a handle;
/// where those turn too far for functions that blend displacements, that is the result.
class FreeTurns {
 public:
  using Affine = MotionBlend::Affine;

  /// free: by handle, whether it only places.
  FreeTurns(const BoundSurface& bound, std::vector<char> free);
  const std::vector<char>& free() const { return free_; }

  /// motions: in the surface's own unit; of a free handle only where it takes its pivot matters,
  /// and its rotation is put in. pivots: h×3, at rest. turns: as for MotionBlend::take(), or empty;
  /// those of free handles are put in.
  void find(std::vector<Affine>& motions, const Positions& pivots,
            std::vector<double>& turns) const;

  /// The same where a base from outside turns them: by the rotation nearest to what that does
  /// around each. base: B', in order().
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
  std::vector<int> handles_;  // the free ones
  // Handles on the same loose part have to do with one another, those on others have not.
  struct Part {
    std::vector<int> turning, free;  // handles; free: places in handles_
    bool fixed = false;              // whether it has a fixed vertex
  };
  std::vector<Part> parts_;
  RowMatrix weights_;  // f×h: harmonic, of the others at a free handle let go
  RowMatrix energy_;   // Wᵀ L W, its rows of free handles
  RowMatrix pull_;     // of each cluster Σ div(G_j) W, three rows
  RowMatrix at_rest_;  // 3k×3, the same with q for W
  struct Corner {
    int row;  // in order()
    Eigen::Vector3d flux;
  };
  std::vector<std::vector<Corner>> around_;  // of each free handle's own cluster
};

}  // namespace dd
