// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "support/thread_pool.h"
#include "support/types.h"

namespace dd {

/// A recursive bisection of a graph whose vertices have places, by planes: for surfaces these
/// separate about as well as graph partitioning, and take much less time (geometric nested
/// dissection: George 1973; Heath, Raghavan 1995).
///
/// One bisection serves all matrices whose graphs are powers of this one, as those of the Laplacian
/// and of K: their separators are what touches the other side of a cut.
class Dissection {
 public:
  /// graph: symmetric, both triangles stored; n places. pool: null, or for this call.
  Dissection(const SparseMatrix& graph, const Positions& places, ThreadPool* pool = nullptr);

  /// A fill-reducing order of a matrix over the same vertices: the vertex at each place.
  std::vector<int> order(const SparseMatrix& pattern) const;

 private:
  friend class Bisector;
  static constexpr int kMostCuts = 31;  // one after the other: two bits of a key each
  // Of each vertex its side of each cut that it met, the first in the lowest bit, and on which
  // sides of these cuts the separator lies.
  std::vector<uint32_t> sides_, separator_sides_;
  std::vector<uint8_t> cut_count_;
};

/// An order by approximate minimum degree (Amestoy, Davis, Duff 1996), for graphs without places.
std::vector<int> minimum_degree(const SparseMatrix& pattern);

}  // namespace dd
