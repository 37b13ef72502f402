// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "support/types.h"

namespace dd {

/// The plan of a sparse Cholesky factorization, from the pattern of the matrix alone: the order,
/// the elimination tree and its supernodes, sets of consecutive columns with the same rows below
/// them (Liu, Ng, Peyton 1993), made a little larger where that saves time (relaxed: Ashcraft,
/// Grimes 1989). Davis, Direct Methods for Sparse Linear Systems (2006), explains all of it.
///
/// The tree falls into a few domains, which have nothing to do with one another, and the top, which
/// all of them hang on. Places of the order: domain after domain, then the top. Their number does
/// not depend on the threads, nor does any result.
struct SymbolicCholesky {
  /// pattern: both triangles stored. first_order: a fill-reducing order of its rows.
  SymbolicCholesky(const SparseMatrix& pattern, const std::vector<int>& first_order);

  std::vector<int> order;     ///< row of the matrix at each place
  std::vector<int> place_of;  ///< place of each row

  /// Supernode s has the places begin[s] to begin[s + 1], and below them the places
  /// rows[row_begin[s]] to rows[row_begin[s + 1]], ascending.
  std::vector<int> begin;
  std::vector<int64_t> row_begin;
  std::vector<int> rows;
  std::vector<int> parent;  ///< a later supernode, or -1

  /// Supernodes domain_begin[d] to domain_begin[d + 1] are domain d; the last entry is where the
  /// top begins.
  std::vector<int> domain_begin;
  /// Rows as a solve addresses them, so that domains can work at the same time: a domain's rows in
  /// the top are slots of its own behind the last place.
  std::vector<int> slots;
  std::vector<int> slot_begin;   ///< of each domain, and the end: slots − size()
  std::vector<int> slot_target;  ///< place in the top of each slot

  int size() const { return static_cast<int>(order.size()); }
  int supernode_count() const { return static_cast<int>(begin.size()) - 1; }
  int domain_count() const { return static_cast<int>(domain_begin.size()) - 1; }
  int slotted_size() const { return size() + static_cast<int>(slot_target.size()); }
  int width(int s) const { return begin[s + 1] - begin[s]; }
  int height(int s) const { return static_cast<int>(row_begin[s + 1] - row_begin[s]); }
  /// The first supernode of a domain, of the top for domain_count(), and the end after that.
  int first_supernode(int part) const {
    return part > domain_count() ? supernode_count() : domain_begin[part];
  }
  /// Where the places of a domain begin, of the top for domain_count(), and the end after that.
  int section_begin(int part) const { return begin[first_supernode(part)]; }

 private:
  void make_slots();
};

}  // namespace dd
