// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "support/thread_pool.h"
#include "support/types.h"

namespace dd {

/// Geometric nested dissection (George 1973; Heath, Raghavan 1995): recursive bisection by planes
/// of a graph whose vertices have positions. For surfaces its separators are about as small as
/// those of graph partitioning, which takes much longer.
///
/// One bisection serves all matrices whose graphs are powers of this one, as those of L and K: the
/// separator of a cut is made of the vertices that have neighbours across it in the matrix.
class Dissection {
 public:
  /// graph: n×n, symmetric, both triangles stored. positions: n×3. pool: may be null; not kept.
  Dissection(const SparseMatrix& graph, const Positions& positions, ThreadPool* pool = nullptr);

  /// A fill-reducing order of a matrix on the same vertices: the vertex at each index.
  std::vector<int> order(const SparseMatrix& pattern) const;

 private:
  friend class Bisector;
  static constexpr int kMostCuts = 31;  // of a vertex. Derived: two bits each of a 64-bit key
  // For each vertex a bit for each of its cuts, the first the lowest: its own side, and the side
  // that the separator is taken from; 1 is above.
  std::vector<uint32_t> sides_, separator_sides_;
  std::vector<uint8_t> cut_count_;
};

/// An order by approximate minimum degree (Amestoy, Davis, Duff 1996), for graphs without
/// positions.
std::vector<int> minimum_degree(const SparseMatrix& pattern);

}  // namespace dd
