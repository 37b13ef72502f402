// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/mesh.h"

#include <cmath>
#include <sstream>
#include <string>

#include "mesh/unit_box.h"
#include "support/error.h"

namespace dd {

void validate(const Mesh& mesh) {
  const int n = mesh.vertex_count();
  if (n == 0) throw Error(Status::mesh, "The mesh has no vertices: there is nothing to deform.");
  if (mesh.triangle_count() == 0)
    throw Error(Status::mesh, "The mesh has no faces: the method works on surfaces, add faces.");
  for (int v = 0; v < n; ++v) {
    if (!mesh.positions.row(v).allFinite())
      throw Error(Status::mesh, "Vertex " + std::to_string(v) +
                                    " has a coordinate that is not a finite number: delete or move "
                                    "that vertex.");
    const double largest = mesh.positions.row(v).cwiseAbs().maxCoeff();
    if (largest > kFarthest) {
      std::ostringstream sentence;
      sentence << "Vertex " << v << " has a coordinate of " << largest
               << ", which is too far away to compute with: delete or move that vertex.";
      throw Error(Status::mesh, sentence.str());
    }
  }
  for (int t = 0; t < mesh.triangle_count(); ++t) {
    const auto corners = mesh.triangles.row(t);
    for (int k = 0; k < 3; ++k) {
      if (corners[k] < 0 || corners[k] >= n)
        throw Error(Status::mesh, "Triangle " + std::to_string(t) + " refers to vertex " +
                                      std::to_string(corners[k]) + ", but there are only " +
                                      std::to_string(n) + ": validate the mesh.");
    }
    if (corners[0] == corners[1] || corners[1] == corners[2] || corners[2] == corners[0])
      throw Error(Status::mesh,
                  "Triangle " + std::to_string(t) + " uses one vertex twice: validate the mesh.");
  }
  if (!(bounding_box_diagonal(mesh.positions) > 0))
    throw Error(Status::mesh, "All vertices are at one point: the mesh has no surface to deform.");
}

void validate(const Mesh& mesh, const char* which) {
  try {
    validate(mesh);
  } catch (const Error& error) {
    throw Error(error.status(), std::string("The ") + which + ": " + error.what());
  }
}

}  // namespace dd
