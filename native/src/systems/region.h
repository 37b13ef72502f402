// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mesh/mesh.h"

namespace dd {

// Roles of vertices that are in no handle; handles have the numbers from 0 on.
constexpr int kFree = -1;
constexpr int kFixed = -2;

/// The role of each vertex: free (solved for), fixed, or moved by a handle. The free vertices are
/// the rows of every system (F in the paper's F×F blocks).
struct Region {
  std::vector<int> role;             ///< n: kFree, kFixed or a handle number
  std::vector<int> free;             ///< vertex of each row
  std::vector<int> row;              ///< n: row of a free vertex, else -1
  std::vector<int> handle_vertices;  ///< all vertices that are in a handle, ascending
  /// One free vertex of each component without constrained vertices, which only MovedBy::base
  /// leaves free: there L is singular, see ground().
  std::vector<int> grounds;
  int handle_count = 0;

  /// Vertices given as free but made fixed, because no handle can move them.
  std::vector<int> resting;  ///< in components without a handle
  int resting_component_count = 0;
  std::vector<int> isolated;      ///< without a triangle
  std::vector<int> idle_handles;  ///< handles without a free neighbour

  int free_count() const { return static_cast<int>(free.size()); }
};

/// The triangles with a free corner, ascending.
std::vector<int> triangles_with_free_corners(const Region& region, const Triangles& triangles);

/// Numbers the free vertices of the given roles, which are not checked; independent of the mesh and
/// its kind of elements.
Region region_of_roles(std::vector<int> roles, int handle_count);

/// Throws Error(region) naming the vertex whose role is neither kFree nor kFixed nor a handle, or
/// the handle without a vertex.
void check_roles(const std::vector<int>& roles, int handle_count);

/// Where the motion of the free vertices comes from.
enum class MovedBy {
  handles,
  base  ///< a base from outside; there may be no handles
};

/// Makes a region of the given roles (n values: kFree, kFixed or a handle below handle_count).
///
/// With MovedBy::handles the free vertices of a component without a handle vertex become fixed:
/// without any constrained vertex its systems would be singular, and with fixed ones only its
/// solution is the rest shape. Free vertices without a triangle become fixed too. Both are listed.
/// Throws Error(region) when a role is out of range, a handle is missing or has no vertex, or
/// nothing stays free.
Region make_region(const Mesh& mesh, const std::vector<int>& roles, int handle_count,
                   MovedBy moved_by = MovedBy::handles);

}  // namespace dd
