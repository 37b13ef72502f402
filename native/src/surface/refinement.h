// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <utility>
#include <vector>

#include "kernels/kernels.h"
#include "surface/bound_surface.h"
#include "surface/gradients.h"

namespace dd {

/// Beyond the paper: rotations inferred from a linear base are too small where it bends far, so S'
/// shrinks. Each iteration takes the rotation R_j of every triangle from S to S' (15), smooths them
/// over the surface, and solves L p' = div(R_jᵀ) once more with the same factor. Smoothing is what
/// carries the bending; without it this is as-rigid-as-possible editing, which folds.
///
/// Triangles without a free corner keep the rotation that the handles give them: they are what the
/// smoothing hangs on.
///
/// The smoothing is kPasses means, each of the triangles around the vertices and then of the
/// vertices of the triangles. In between only the vertices are kept: what a pass makes of them is a
/// mean over their neighbours, which is half the work.
template <class Real>
class Refinement {
 public:
  explicit Refinement(BoundSurface& bound);

  /// offsets: the displacement of all rows, improved in the free ones.
  void run(int iterations, Rows& offsets);

  double bytes() const;

 private:
  /// For each vertex the rows whose rotations it averages, kLanes vertices a block: what one of
  /// them has less than the others has no weight.
  struct Averages {
    std::vector<int> starts{0};
    std::vector<std::array<int32_t, kLanes>> index;
    std::vector<std::array<Real, kLanes>> weights;
    int count() const { return static_cast<int>(starts.size()) - 1; }
    double bytes() const {
      return static_cast<double>(starts.size() * sizeof(int) +
                                 index.size() * kLanes * (sizeof(int32_t) + sizeof(Real)));
    }
  };
  /// The terms of kLanes averages that are being collected.
  using Terms = std::array<std::vector<std::pair<int, double>>, kLanes>;
  using Quaternions = std::vector<Real>;  // rows of 4
  static constexpr int kPasses = 6;

  void make_averages(const std::vector<int>& vertices, const std::vector<int>& local_vertex,
                     const std::vector<int>& local_triangle, int first_rim);
  static void append(Averages& averages, Terms& terms);
  void make_turns(const std::vector<int>& local_vertex);
  int first_held_row() const { return kLanes * of_neighbours_.count(); }
  void apply(const Averages& averages, const Quaternions& in, Quaternions& out) const;
  /// Of the triangles without a free corner, which only the handles move.
  void find_held_rotations();
  /// Smoothed, of what positions_ shows.
  void find_vertex_rotations();
  /// As PoissonSystem::solve() takes it.
  void add(int part, double* rows) const;

  BoundSurface& bound_;
  // Triangles are numbered anew: those with a free corner, padded to whole blocks, then those
  // without that share a vertex with them.
  std::vector<RotationBlock<Real>> moving_, held_;
  ActiveBlocks layout_;
  std::vector<TurnBlock<Real>> turns_;
  // For each vertex, of the rotations of its triangles; of those of vertices, and of the triangles
  // without a free corner.
  Averages of_triangles_, of_neighbours_;
  Quaternions triangle_rotations_, vertex_rotations_, smoothed_;
  Rows positions_, at_rest_;
};

}  // namespace dd
