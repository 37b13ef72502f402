// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <vector>

#include "mesh/mesh.h"

namespace dd {

/// Which triangles of a source mesh give each triangle of a target its deformation gradient: none,
/// one or many (§3: Sumner and Popović 2004).
struct Correspondence {
  /// Target triangle j has the sources source[begin[j]] to source[begin[j + 1]].
  std::vector<int> begin;
  std::vector<int> source;

  int target_count() const { return static_cast<int>(begin.size()) - 1; }
  bool has_source(int target) const { return begin[target] < begin[target + 1]; }
};

/// Numbers of a source and a target element.
using Pairs = std::vector<std::array<int, 2>>;

/// From pairs of triangles, in any order; repeated pairs count once.
/// Throws Error(argument) naming the pair that is out of range, or when there are none.
Correspondence triangle_correspondence(const Pairs& pairs, int source_triangles,
                                       int target_triangles);

/// From pairs of vertices: a target triangle's sources are the triangles of the source that have
/// the most corners among those paired with its own. Throws as triangle_correspondence() and
/// validate().
Correspondence vertex_correspondence(const Pairs& pairs, const Mesh& source, const Mesh& target);

/// Of each triangle number itself.
Correspondence same_topology(const Mesh& source, const Mesh& target);

}  // namespace dd
