// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <vector>

#include "mesh/mesh.h"

namespace dd {

/// For each triangle of a target mesh the source triangles that give it its deformation gradient:
/// none, one or many (§3: Sumner and Popović 2004).
struct Correspondence {
  /// Target triangle j has the sources source[begin[j]] to source[begin[j + 1] − 1].
  std::vector<int> begin;
  std::vector<int> source;

  int target_count() const { return static_cast<int>(begin.size()) - 1; }
  bool has_source(int target) const { return begin[target] < begin[target + 1]; }
};

/// Pairs of indices, {source, target}, of triangles or of vertices.
using Pairs = std::vector<std::array<int, 2>>;

/// From pairs of triangles, in any order; duplicates count once. Throws Error(argument) if there
/// are no pairs, or if one is out of range, which it names.
Correspondence triangle_correspondence(const Pairs& pairs, int source_triangles,
                                       int target_triangles);

/// From pairs of vertices: the sources of a target triangle are the source triangles with the most
/// corners paired with its own. Throws as triangle_correspondence() and validate(), and if no
/// triangle has a source.
Correspondence vertex_correspondence(const Pairs& pairs, const Mesh& source, const Mesh& target);

/// Each triangle to the one of the same index. Throws Error(argument) if the meshes differ in the
/// number of vertices or in their triangles.
Correspondence identity_correspondence(const Mesh& source, const Mesh& target);

}  // namespace dd
