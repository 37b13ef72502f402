// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "support/types.h"

namespace dd {

/// A triangle soup: an edge may have any number of triangles, a vertex may have none.
struct Mesh {
  Positions positions;
  Triangles triangles;

  int vertex_count() const { return static_cast<int>(positions.rows()); }
  int triangle_count() const { return static_cast<int>(triangles.rows()); }
};

/// Largest absolute coordinate that is accepted, in the caller's units. Safety: positions are
/// exchanged in single precision, which ends at 3.4e38.
constexpr double kMaxCoordinate = 1e30;

/// Indices of the vertices with a coordinate that is not finite or beyond kMaxCoordinate.
std::vector<int> vertices_with_bad_coordinates(const Positions& positions);

/// Which of several meshes an error is about.
enum class MeshOf { itself, source, target, base };

/// Throws Error(mesh) if the mesh is unusable: no vertices or triangles, coordinates that are not
/// finite or beyond kMaxCoordinate, vertex indices out of range or twice in a triangle, no extent.
/// Its subject is the first such vertex or triangle; Error::vertices() has those of all, except for
/// indices out of range.
void validate(const Mesh& mesh, MeshOf which = MeshOf::itself);

/// The mesh reflected in x, its triangles reversed so that normals keep pointing outwards.
Mesh mirror_image(Mesh mesh);

}  // namespace dd
