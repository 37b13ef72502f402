// SPDX-License-Identifier: GPL-3.0-or-later
#include "systems/region.h"

#include "catch.h"
#include "meshes.h"
#include "support/error.h"

using namespace dd;

namespace {

std::string refusal(const Mesh& mesh, const std::vector<int>& roles, int handles) {
  try {
    make_region(mesh, roles, handles);
  } catch (const Error& error) {
    CHECK(error.status() == Status::region);
    return error.what();
  }
  return "accepted";
}

}  // namespace

TEST_CASE("free vertices are the rows, handle vertices are listed") {
  const Mesh mesh = test::bumpy_plane(6, 2);
  const auto roles = test::strip_roles(6, 6, 2, 5);
  const Region region = make_region(mesh, roles, 1);
  CHECK(region.free_count() == 3 * 6);
  CHECK(region.handle_vertices.size() == 6);
  CHECK(region.resting.size() + region.isolated.size() == 0);
  for (int r = 0; r < region.free_count(); ++r) {
    CHECK(roles[region.free[r]] == kFree);
    CHECK(region.row[region.free[r]] == r);
  }
}

TEST_CASE("parts that no handle reaches rest, and are counted") {
  const Mesh one = test::sphere(1);
  Mesh mesh = test::appended(test::appended(one, one), one);
  mesh.positions.conservativeResize(mesh.positions.rows() + 2, 3);
  mesh.positions.bottomRows(2).setOnes();
  const int n = one.vertex_count();
  std::vector<int> roles(static_cast<size_t>(mesh.vertex_count()), kFree);
  roles[0] = 0;                                       // part 0: a handle, nothing fixed
  roles[n + 3] = kFixed;                              // part 1: held, but no handle
  const Region region = make_region(mesh, roles, 1);  // part 2: neither
  CHECK(region.free_count() == n - 1);
  CHECK(region.resting.size() == size_t(2 * n - 1));
  CHECK(region.resting_component_count == 2);
  CHECK(region.resting.front() == n);
  CHECK(region.isolated == std::vector<int>{3 * n, 3 * n + 1});
  for (int v = n; v < mesh.vertex_count(); ++v) CHECK(region.role[v] == kFixed);
}

TEST_CASE("handles that nothing follows are named") {
  const Mesh mesh = test::bumpy_plane(8, 2);
  auto roles = test::strip_roles(8, 8, 5, 7);  // columns 0 to 4 are fixed
  CHECK(make_region(mesh, roles, 1).idle_handles.empty());
  roles[0] = 1;
  CHECK(make_region(mesh, roles, 2).idle_handles == std::vector<int>{1});
}

TEST_CASE("roles that leave nothing to do are refused with a message") {
  const Mesh mesh = test::sphere(1);
  const auto size = static_cast<size_t>(mesh.vertex_count());
  std::vector<int> roles(size, kFree);
  CHECK_THAT(refusal(mesh, roles, 0), contains("no handle"));
  CHECK_THAT(refusal(mesh, roles, 1), contains("Handle 0 has no vertices"));
  roles[2] = 0;
  CHECK(refusal(mesh, roles, 1) == "accepted");
  CHECK_THAT(refusal(mesh, roles, 2), contains("Handle 1 has no vertices"));
  roles[5] = 4;
  CHECK_THAT(refusal(mesh, roles, 1), contains("Vertex 5 has the role 4"));
  roles[5] = -3;
  CHECK_THAT(refusal(mesh, roles, 1), contains("Vertex 5 has the role -3"));
  CHECK_THAT(refusal(mesh, std::vector<int>(size, 0), 1), contains("No vertex is free"));

  const Mesh two = test::appended(mesh, mesh);
  std::vector<int> apart(2 * size, kFixed);
  apart[1] = 0;
  apart[size + 1] = kFree;
  CHECK_THAT(refusal(two, apart, 1), contains("other loose parts"));
}
