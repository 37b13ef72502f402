// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "types.h"

namespace dd {

/// A fill-reducing order by nested dissection (George 1973) of a graph whose vertices have places:
/// the separators come from planes, as in geometric partitioning (Heath and Raghavan 1995), which
/// for surfaces is as good as graph partitioning and much faster.
///
/// pattern: symmetric, both triangles stored; n places. Returns the vertex at each place of the
/// order.
std::vector<int> nested_dissection(const SparseMatrix& pattern, const Positions& places);

/// By approximate minimum degree (Amestoy, Davis, Duff 1996), for graphs without places.
std::vector<int> minimum_degree(const SparseMatrix& pattern);

}  // namespace dd
