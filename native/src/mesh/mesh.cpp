// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/mesh.h"

#include <sstream>
#include <string>
#include <utility>

#include "mesh/unit_box.h"
#include "support/error.h"

namespace dd {

std::vector<int> vertices_with_bad_coordinates(const Positions& positions) {
  std::vector<int> found;
  for (Index v = 0; v < positions.rows(); ++v)
    // Negated, so that NaN fails the comparison, too.
    if (!(positions.row(v).cwiseAbs().maxCoeff() <= kMaxCoordinate) ||
        !positions.row(v).allFinite())
      found.push_back(static_cast<int>(v));
  return found;
}

namespace {

/// Kinds of subjects of a mesh's errors, and its name.
struct Named {
  const char* name;
  Subject::Kind vertex, triangle;
};

Named named(MeshOf which) {
  switch (which) {
    case MeshOf::source:
      return {"The source", Subject::source_vertex, Subject::source_triangle};
    case MeshOf::target:
      return {"The target", Subject::target_vertex, Subject::target_triangle};
    case MeshOf::base:
      return {"The base", Subject::base_vertex, Subject::base_triangle};
    default:
      return {"The mesh", Subject::vertex, Subject::triangle};
  }
}

}  // namespace

void validate(const Mesh& mesh, MeshOf which) {
  const int n = mesh.vertex_count();
  const Named of = named(which);
  const std::string name = of.name;
  if (n == 0) throw Error(Status::mesh, name + " has no vertices", Remedy::add_faces);
  if (mesh.triangle_count() == 0)
    throw Error(Status::mesh, name + " has no faces", Remedy::add_faces);
  if (std::vector<int> lost = vertices_with_bad_coordinates(mesh.positions); !lost.empty()) {
    const int v = lost.front();
    std::ostringstream message;
    if (mesh.positions.row(v).allFinite())
      message << "has a coordinate of " << mesh.positions.row(v).cwiseAbs().maxCoeff()
              << ", which is too far away to compute with";
    else
      message << "has a coordinate that is not a finite number";
    throw Error(Status::mesh, {of.vertex, v}, message.str(), Remedy::move_vertex, std::move(lost));
  }
  std::vector<int> of_folded;
  int folded = -1;
  for (int t = 0; t < mesh.triangle_count(); ++t) {
    const auto corners = mesh.triangles.row(t);
    for (int k = 0; k < 3; ++k) {
      if (corners[k] < 0 || corners[k] >= n)
        throw Error(Status::mesh, {of.triangle, t},
                    "refers to vertex " + std::to_string(corners[k]) + ", but there are only " +
                        std::to_string(n),
                    Remedy::validate_mesh);
    }
    if (corners[0] == corners[1] || corners[1] == corners[2] || corners[2] == corners[0]) {
      if (folded < 0) folded = t;
      of_folded.insert(of_folded.end(), corners.begin(), corners.end());
    }
  }
  if (folded >= 0)
    throw Error(Status::mesh, {of.triangle, folded}, "uses one vertex twice", Remedy::validate_mesh,
                std::move(of_folded));
  if (!(bounding_box_diagonal(mesh.positions) > 0))
    throw Error(Status::mesh, name + " has all vertices at one point, so no surface to deform");
}

Mesh mirror_image(Mesh mesh) {
  mesh.positions.col(0) *= -1;
  mesh.triangles.col(1).swap(mesh.triangles.col(2));
  return mesh;
}

}  // namespace dd
