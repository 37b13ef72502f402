// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mesh/mesh.h"

namespace dd {

constexpr int kFree = -1;
constexpr int kFixed = -2;

/// What each vertex does: solved for (free), held (fixed) or moved by a handle. The free vertices
/// are the rows of every system (F in the paper's F×F blocks).
struct Region {
  std::vector<int> role;             ///< n: kFree, kFixed or a handle number
  std::vector<int> free;             ///< vertex of each row
  std::vector<int> row;              ///< n: row of a free vertex, else -1
  std::vector<int> handle_vertices;  ///< all vertices that are in a handle, ascending
  /// One free vertex of each part without any constrained one, which a base from outside carries.
  std::vector<int> grounds;
  int handle_count = 0;

  /// Vertices that were asked to be free but are held, because no handle can move them.
  std::vector<int> resting;  ///< of parts without a handle
  int resting_component_count = 0;
  std::vector<int> loose;         ///< without a triangle
  std::vector<int> idle_handles;  ///< those that have no free vertex for a neighbour

  int free_count() const { return static_cast<int>(free.size()); }
};

/// The rows of vertices with these roles, which are taken as they are: any mesh's, any element's.
Region region_of(std::vector<int> roles, int handle_count);

/// Throws Error(region) naming the vertex whose role is none of kFree, kFixed and the handles, or
/// the handle that has no vertex.
void check_roles(const std::vector<int>& roles, int handle_count);

/// What moves free vertices.
enum class MovedBy {
  handles,
  base  ///< from outside: handles are not needed
};

/// Splits the vertices by the given roles (n values: kFree, kFixed or a handle below handle_count).
///
/// Moved by handles, a free vertex of a loose part without any handle vertex becomes fixed: where
/// nothing holds the part both systems would be singular, and where only fixed vertices do the
/// solution is the rest shape. A free vertex without a triangle becomes fixed too. Both are
/// counted. Throws Error(region) when a role is out of range, a handle has no vertex, or nothing
/// stays free.
Region split_region(const Mesh& mesh, const std::vector<int>& roles, int handle_count,
                    MovedBy moved_by = MovedBy::handles);

}  // namespace dd
