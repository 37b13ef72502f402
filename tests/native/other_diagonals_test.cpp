// SPDX-License-Identifier: GPL-3.0-or-later
// Quads whose diagonals the cotangent Laplacian does not see.
#include "reconstruction/other_diagonals.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "catch.h"
#include "mesh/triangles.h"
#include "meshes.h"

using namespace dd;
using namespace dd::test;

namespace {

OtherDiagonals found_on(const Mesh& mesh) {
  std::vector<int> all(size_t(mesh.triangle_count()));
  std::iota(all.begin(), all.end(), 0);
  return other_diagonals(
      mesh.positions, surface_operators(mesh.positions, mesh.triangles, Triangulation::given), all);
}

/// A triangle by its vertices, the least one first.
std::vector<int> from_least(const Eigen::RowVector3i& t) {
  std::vector<int> corners(t.data(), t.data() + 3);
  std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end()), corners.end());
  return corners;
}

}  // namespace

TEST_CASE("the quads of a grid are cut along their other diagonals, with the same normals") {
  const Mesh grid = test::grid(9, 9, [](double, double) { return 0.0; });
  const OtherDiagonals found = found_on(grid);
  CHECK(found.triangles.rows() == grid.triangles.rows());
  for (int j = 0; j < grid.triangle_count(); ++j) {
    const int quad = found.quad_of[size_t(j)];
    REQUIRE(quad >= 0);
    const std::vector<int> own = from_least(grid.triangles.row(j));
    for (int other : {2 * quad, 2 * quad + 1}) {
      const std::vector<int> corners = from_least(found.triangles.row(other));
      CHECK(corners != own);
      // Two corners in common at least, as both lie in a quad.
      CHECK(std::count_if(corners.begin(), corners.end(), [&](int v) {
              return std::find(own.begin(), own.end(), v) != own.end();
            }) >= 2);
      CHECK(edges_and_normal(grid.positions, found.triangles, other).col(2).z() ==
            Approx(edges_and_normal(grid.positions, grid.triangles, j).col(2).z()));
    }
  }
  CHECK(triangle_areas(grid.positions, found.triangles).sum() ==
        Approx(triangle_areas(grid.positions, grid.triangles).sum()));
}

TEST_CASE("equilateral triangles have no other diagonal") {
  Mesh strip;
  strip.positions.resize(8, 3);
  for (int v = 0; v < 8; ++v) strip.positions.row(v) << 0.5 * v, v % 2 * std::sqrt(0.75), 0;
  strip.triangles.resize(6, 3);
  for (int j = 0; j < 6; ++j) strip.triangles.row(j) << j, j + 1 + j % 2, j + 2 - j % 2;
  const OtherDiagonals found = found_on(strip);
  CHECK(found.triangles.rows() == 0);
  CHECK(*std::max_element(found.quad_of.begin(), found.quad_of.end()) == -1);
}
