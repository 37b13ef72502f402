// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/mesh.h"

#include <limits>

#include "catch.h"
#include "mesh/topology.h"
#include "meshes.h"
#include "support/error.h"

using namespace dd;

namespace {

std::string refusal(const Mesh& mesh) {
  try {
    validate(mesh);
  } catch (const Error& error) {
    CHECK(error.status() == Status::mesh);
    return error.what();
  }
  return "accepted";
}

}  // namespace

TEST_CASE("a sound mesh is accepted") { CHECK(refusal(test::sphere(1)) == "accepted"); }

TEST_CASE("a mesh is refused with the vertex or triangle named") {
  Mesh mesh = test::sphere(1);
  SECTION("nothing in it") {
    CHECK_THAT(refusal(Mesh{Positions(0, 3), Triangles(0, 3)}), contains("no vertices"));
    mesh.triangles.resize(0, 3);
    CHECK_THAT(refusal(mesh), contains("no faces"));
  }
  SECTION("coordinates that are not finite") {
    mesh.positions(7, 1) = std::numeric_limits<double>::quiet_NaN();
    CHECK_THAT(refusal(mesh), contains("Vertex 7 "));
    mesh.positions(7, 1) = 0;
    mesh.positions(9, 2) = std::numeric_limits<double>::infinity();
    CHECK_THAT(refusal(mesh), contains("Vertex 9 "));
    mesh.positions(9, 2) = -1e31;
    CHECK_THAT(refusal(mesh), contains("Vertex 9 ") && contains("1e+31"));
  }
  SECTION("vertex numbers") {
    const int n = mesh.vertex_count();
    mesh.triangles(3, 2) = n;
    CHECK_THAT(refusal(mesh), contains("Triangle 3 ") && contains(std::to_string(n)));
    mesh.triangles(3, 2) = -1;
    CHECK_THAT(refusal(mesh), contains("Triangle 3 "));
    mesh.triangles(3, 2) = mesh.triangles(3, 0);
    CHECK_THAT(refusal(mesh), contains("Triangle 3 ") && contains("twice"));
  }
  SECTION("no extent") {
    mesh.positions.setConstant(2);
    CHECK_THAT(refusal(mesh), contains("one point"));
  }
}

TEST_CASE("loose parts are found, vertices without triangles are parts of their own") {
  Mesh mesh = test::appended(test::sphere(1), test::sphere(0));
  const int first = test::sphere(1).vertex_count();
  mesh.positions.conservativeResize(mesh.positions.rows() + 1, 3);
  mesh.positions.bottomRows(1).setZero();
  const Components parts(mesh.triangles, mesh.vertex_count());
  REQUIRE(parts.count == 3);
  for (int v = 0; v < mesh.vertex_count(); ++v)
    CHECK(parts.of_vertex[v] == (v < first ? 0 : v + 1 < mesh.vertex_count() ? 1 : 2));
}
