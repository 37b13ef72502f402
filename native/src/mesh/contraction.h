// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mesh/mesh.h"

namespace dd {

/// A mesh with fewer vertices, each of which stands for those around it. Its triangles are those of
/// the given mesh whose corners went to three of them, so it is connected as that one is.
struct Contraction {
  std::vector<int> vertices;   ///< of the given mesh, ascending: those that are left
  std::vector<int> of_vertex;  ///< n: the one it went to, by its number; -1: not in a triangle
  Triangles triangles;         ///< of such numbers
};

/// radii: how far from a vertex others may go to it, along edges; 0: neither goes it nor do others.
/// Where the surface is too narrow for its radii, as a wire is, nothing goes anywhere: around each
/// vertex that stands for others or is beside such, the triangles that are left make one fan,
/// closed but at a border. Depends on places and not on how vertices are numbered, ties apart.
Contraction contract(const Mesh& mesh, const std::vector<double>& radii);

}  // namespace dd
