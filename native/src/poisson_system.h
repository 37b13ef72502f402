// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <vector>

#include "operators.h"
#include "region.h"
#include "sparse_cholesky.h"

namespace dd {

/// The order of the rows in all that a frame works on: the free vertices as they stand in the
/// Poisson factor, so that a solve permutes nothing, then the handles' vertices, then the fixed.
struct RowOrder {
  std::vector<int> vertex_of_row;
  std::vector<int> row_of_vertex;
  int free_count = 0;   ///< rows below are free, those from here on the handles'
  int fixed_begin = 0;  ///< first row of a fixed vertex

  int count() const { return static_cast<int>(vertex_of_row.size()); }
  /// Where a right-hand side takes what belongs to this vertex: held ones share the row after the
  /// last free one, which nobody reads.
  int target_of_vertex(int vertex) const { return std::min(row_of_vertex[vertex], free_count); }
};

/// L p' = div(...) (4), (14) on the free vertices, factored once, solved for the displacement:
///
///   L (p' − p) = div(G_j S_jᵀ) − L p
///
/// so that resting handles give nothing but rounding and the mesh's size costs no digits.
class PoissonSystem {
 public:
  /// operators: of S. Throws UnsolvableSurface where L is singular.
  PoissonSystem(const Mesh& mesh, const Region& region, const SurfaceOperators& operators);

  const RowOrder& order() const { return order_; }
  /// Triangles with a free corner: the only ones whose gradients matter.
  const std::vector<int>& active_triangles() const { return active_; }

  /// Starts a right-hand side with −L p and with what the displaced handles pull. offsets: the
  /// displacement of all vertices, only the handles' rows are read. Returns free_count + 1 rows, to
  /// which the caller adds div(G_j S_jᵀ).
  double* start(const Rows& offsets);

  /// Solves for what was started and gathered: the free rows of offsets. Parts with a ground come
  /// out with that vertex at rest.
  void solve(Rows& offsets);

  /// Harmonic extension, L x = 0: the free rows of three columns of values from the handles' rows,
  /// with zero on the fixed ones.
  void extend(Rows& values);

  double bytes() const;

 private:
  void subtract_pulls(const Rows& offsets);

  struct Pull {
    int target_row, handle_row;
    double weight;
  };

  SparseCholesky factor_;
  RowOrder order_;
  std::vector<int> active_;
  std::vector<Pull> pulls_;  // L between free vertices and those of handles
  Rows rest_divergence_;     // L p
  SparseCholesky::Space space_;
  Rows rows_;                // right-hand side, then solution; one spare row
};

}  // namespace dd
