// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "reconstruction/whole_surface.h"
#include "systems/region.h"

namespace dd {

/// The part of a mesh that a bind reads, where the region is small beside the mesh: the free
/// vertices, those of handles, and what is around them. A bind of it gives the result of a bind of
/// the whole mesh, to the bit, in the time and the memory of the part.
struct MeshPart {
  Mesh mesh;
  std::vector<int> vertices;   ///< of the whole mesh, ascending
  std::vector<int> triangles;  ///< of the whole mesh, ascending
  Region region;               ///< of the part's vertices
  std::shared_ptr<const WholeSurface> whole;

  /// Null where the part has more than this fraction of the triangles. mesh: in a box of about unit
  /// size. region: of make_region(), moved by handles.
  static std::unique_ptr<MeshPart> make(const Mesh& mesh, const Region& region,
                                        double largest_fraction);
  /// An error about vertices and triangles of the part, in the numbers of the whole mesh.
  Error of_whole(const Error& error) const;
  /// Without the mesh, which the surface takes over.
  double bytes() const;
};

}  // namespace dd
