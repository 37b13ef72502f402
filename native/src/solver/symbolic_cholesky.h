// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "support/types.h"

namespace dd {

/// Symbolic Cholesky factorization, from the pattern of the matrix alone: the order, the
/// elimination tree and its supernodes. These are sets of consecutive columns with the same rows
/// below them (Liu, Ng, Peyton 1993), enlarged where that saves time (relaxed: Ashcraft, Grimes
/// 1989). Davis, Direct Methods for Sparse Linear Systems (2006), explains all of it.
///
/// The tree is split into a few domains, sets of subtrees independent of one another, and the top,
/// the supernodes above them. The order has domain after domain, then the top. Neither the number
/// of domains nor any result depends on the number of threads.
struct SymbolicCholesky {
  /// pattern: both triangles stored. first_order: a fill-reducing order of its rows.
  SymbolicCholesky(const SparseMatrix& pattern, const std::vector<int>& first_order);

  std::vector<int> order;     ///< row of the matrix at each index
  std::vector<int> index_of;  ///< index of each row in order

  /// Supernode s has the indices begin[s] to begin[s + 1] − 1; its rows below are the indices
  /// rows[row_begin[s]] to rows[row_begin[s + 1] − 1], ascending.
  std::vector<int> begin;
  std::vector<int64_t> row_begin;
  std::vector<int> rows;
  std::vector<int> parent;  ///< of each supernode a later one, or -1

  /// Domain d has the supernodes domain_begin[d] to domain_begin[d + 1] − 1; the last entry is the
  /// first supernode of the top.
  std::vector<int> domain_begin;
  /// rows as a solve addresses them: a domain's rows in the top are replaced by slots of its own
  /// after the last index, so that domains can add to them concurrently.
  std::vector<int> slotted_rows;
  std::vector<int> slot_begin;         ///< first slot of each domain minus size(), and the end
  std::vector<int> top_index_of_slot;  ///< index in the top of each slot

  int size() const { return static_cast<int>(order.size()); }
  int supernode_count() const { return static_cast<int>(begin.size()) - 1; }
  int domain_count() const { return static_cast<int>(domain_begin.size()) - 1; }
  int slotted_size() const { return size() + static_cast<int>(top_index_of_slot.size()); }
  int width(int s) const { return begin[s + 1] - begin[s]; }
  int height(int s) const { return static_cast<int>(row_begin[s + 1] - row_begin[s]); }
  /// The first supernode of a domain, of the top for domain_count(), or the end for larger ones.
  int first_supernode(int section) const {
    return section > domain_count() ? supernode_count() : domain_begin[section];
  }
  /// The first index of a domain, of the top for domain_count(), or the end for larger ones.
  int section_begin(int section) const { return begin[first_supernode(section)]; }

 private:
  void make_slots();
};

}  // namespace dd
