// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/mesh.h"

#include <sstream>
#include <string>
#include <utility>

#include "mesh/unit_box.h"
#include "support/error.h"

namespace dd {

std::vector<int> unusable_places(const Positions& positions) {
  std::vector<int> found;
  for (Index v = 0; v < positions.rows(); ++v)
    // Written so that what is not a number is found, too.
    if (!(positions.row(v).cwiseAbs().maxCoeff() <= kFarthest) || !positions.row(v).allFinite())
      found.push_back(static_cast<int>(v));
  return found;
}

void validate(const Mesh& mesh) {
  const int n = mesh.vertex_count();
  if (n == 0) throw Error(Status::mesh, "The mesh has no vertices: there is nothing to deform.");
  if (mesh.triangle_count() == 0)
    throw Error(Status::mesh, "The mesh has no faces: the method works on surfaces, add faces.");
  if (std::vector<int> lost = unusable_places(mesh.positions); !lost.empty()) {
    const int v = lost.front();
    std::ostringstream sentence;
    sentence << "Vertex " << v;
    if (mesh.positions.row(v).allFinite())
      sentence << " has a coordinate of " << mesh.positions.row(v).cwiseAbs().maxCoeff()
               << ", which is too far away to compute with: delete or move that vertex.";
    else
      sentence << " has a coordinate that is not a finite number: delete or move that vertex.";
    throw Error(Status::mesh, sentence.str(), std::move(lost));
  }
  std::vector<int> of_folded;
  int folded = -1;
  for (int t = 0; t < mesh.triangle_count(); ++t) {
    const auto corners = mesh.triangles.row(t);
    for (int k = 0; k < 3; ++k) {
      if (corners[k] < 0 || corners[k] >= n)
        throw Error(Status::mesh, "Triangle " + std::to_string(t) + " refers to vertex " +
                                      std::to_string(corners[k]) + ", but there are only " +
                                      std::to_string(n) + ": validate the mesh.");
    }
    if (corners[0] == corners[1] || corners[1] == corners[2] || corners[2] == corners[0]) {
      if (folded < 0) folded = t;
      of_folded.insert(of_folded.end(), corners.begin(), corners.end());
    }
  }
  if (folded >= 0)
    throw Error(Status::mesh,
                "Triangle " + std::to_string(folded) + " uses one vertex twice: validate the mesh.",
                std::move(of_folded));
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

Mesh mirror_image(Mesh mesh) {
  mesh.positions.col(0) *= -1;
  mesh.triangles.col(1).swap(mesh.triangles.col(2));
  return mesh;
}

}  // namespace dd
