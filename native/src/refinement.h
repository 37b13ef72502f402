// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "bound_surface.h"
#include "kernels.h"

namespace dd {

/// Beyond the paper: rotations inferred from a linear base are too small where it bends far, so S'
/// shrinks. Each iteration takes the rotation R_j of every triangle from S to S' (15), smooths them
/// over the surface, and solves L p' = div(R_jᵀ) once more with the same factor. Smoothing is what
/// carries the bending; without it this is as-rigid-as-possible editing, which folds.
///
/// Triangles without a free corner keep the rotation that the handles give them: they are what the
/// smoothing hangs on.
class Refinement {
 public:
  explicit Refinement(BoundSurface& bound);

  /// offsets: the displacement of all rows, improved in the free ones.
  void run(int iterations, Rows& offsets);

  double bytes() const;

 private:
  /// For each item the others whose rotations it averages.
  struct Averages {
    std::vector<int> starts{0}, index;
    std::vector<double> weights;
    int count() const { return static_cast<int>(starts.size()) - 1; }
    void apply(const Rows& in, Rows& out) const;
    double bytes() const;
  };
  static constexpr int kPasses = 6;

  BoundSurface& bound_;
  // Triangles are numbered anew: those with a free corner, padded to whole blocks, then those
  // without that share a vertex with them.
  std::vector<RotationBlock> moving_, held_;
  std::vector<TurnBlock> turns_;
  Averages of_vertices_, of_triangles_;
  Rows positions_;
  Rows triangle_rotations_, vertex_rotations_;
};

}  // namespace dd
