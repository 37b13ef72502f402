// SPDX-License-Identifier: GPL-3.0-or-later
#include "match/part_pairs.h"

#include "catch.h"
#include "faces.h"
#include "match/registration.h"
#include "match/triangle_match.h"
#include "mesh/topology.h"
#include "mesh/triangles.h"
#include "meshes.h"

using namespace dd;
using test::ball;
using test::face;
using test::to_eye;

namespace {

std::vector<int> parts_of(const Mesh& mesh) {
  return Components(mesh.triangles, mesh.vertex_count()).of_vertex;
}

/// For each vertex the part of the other mesh that has its nearest point.
std::vector<int> nearest_parts(const Mesh& mesh, const Mesh& other) {
  const LooseParts own(mesh), others(other);
  const PartPairs pairs(mesh, own, other, others);
  const Positions normals = summed_normals(mesh.positions, mesh.triangles);
  const AabbTree tree(other);
  const std::vector<int> of_other = parts_of(other);
  std::vector<int> found;
  for (int v = 0; v < mesh.vertex_count(); ++v) {
    const PointOnTriangle point = pairs.nearest_facing(tree, v, mesh.positions.row(v).transpose(),
                                                       normals.row(v).transpose(), 10);
    found.push_back(of_other[size_t(other.triangles(point.triangle, 0))]);
  }
  return found;
}

}  // namespace

TEST_CASE("loose parts are matched with their counterparts, though other parts are nearer") {
  const Mesh source = face(4, 0.3, 0.7), target = face(4, 0.26, 0.7, 0.99);
  CHECK(nearest_parts(target, source) == parts_of(target));
  CHECK(nearest_parts(source, target) == parts_of(source));
  // Nearest points alone would mix the parts up.
  const AabbTree tree(source);
  const std::vector<int> of_source = parts_of(source), of_target = parts_of(target);
  int others = 0;
  for (int v = 0; v < target.vertex_count(); ++v) {
    const PointOnTriangle any =
        tree.nearest(target.positions.row(v).transpose(), 10, [](int) { return true; });
    others += of_source[size_t(source.triangles(any.triangle, 0))] != of_target[size_t(v)];
  }
  CHECK(others > 20);
}

TEST_CASE("teeth are matched with a row that is shifted by most of a tooth") {
  Mesh row = ball(3, {0, 0, 10}, 4);
  for (int i = 0; i < 14; ++i) row = test::appended(row, ball(2, {0.5 * i, 0.02 * i * i, 0}, 0.2));
  Mesh other = row;
  const std::vector<int> parts = parts_of(row);
  for (Index v = 0; v < row.positions.rows(); ++v)
    if (parts[size_t(v)] > 0) other.positions(v, 0) += 0.4;
  CHECK(nearest_parts(row, other) == parts);
  CHECK(nearest_parts(other, row) == parts);
}

TEST_CASE("one loose part may correspond to several, and one without a counterpart to another") {
  const Mesh source = face(4, 0.3, 0.7);
  // Each eye's rear is joined to the skin by a triangle: one part, of nearly the same shape.
  Mesh grown = source;
  const std::vector<int> parts = parts_of(source);
  const Index count = grown.triangles.rows();
  grown.triangles.conservativeResize(count + 2, 3);
  for (int eye : {1, 2}) {
    int first = 0;
    while (parts[size_t(first)] != eye) ++first;
    grown.triangles.row(count + eye - 1) << 0, first, first + 1;
  }
  grown.positions *= 1.001;
  REQUIRE(Components(grown.triangles, grown.vertex_count()).count == 1);
  const std::vector<int> nearest = nearest_parts(grown, source);
  int others = 0;
  for (size_t v = 0; v < parts.size(); ++v) others += nearest[v] != parts[v];
  CHECK(others <= 3 * 2);  // corners of the added triangles, which turn the normals there
  const Mesh skin = ball(4, {0, 0, 0}, 1);
  CHECK(nearest_parts(source, skin) == std::vector<int>(parts.size(), 0));
}

TEST_CASE("a fit and what corresponds keep eyes and skin apart") {
  const Mesh source = face(4, 0.3, 0.6), target = face(5, 0.24, 0.8, 1.03);
  const Pairs markers = {
      {0, 0}, {1, 1}, {2, 2}, {3, 3}, {4, 4}};  // a ball alone leaves the rotation open
  const Mesh fitted = {register_onto(source, target, markers, {}), source.triangles};
  const Match match = match_triangles(fitted, target, 0.1);
  const std::vector<int> of_source = parts_of(source), of_target = parts_of(target);
  int others = 0, with_source = 0;
  for (int j = 0; j < target.triangle_count(); ++j)
    for (int k = match.correspondence.begin[j]; k < match.correspondence.begin[j + 1]; ++k) {
      ++with_source;
      others += of_source[size_t(source.triangles(match.correspondence.source[k], 0))] !=
                of_target[size_t(target.triangles(j, 0))];
    }
  CHECK(with_source > target.triangle_count());
  CHECK(others == 0);
  for (int v = 0; v < source.vertex_count(); ++v)
    if (of_source[size_t(v)] > 0) {
      const Eigen::RowVector3d way = to_eye(of_source[size_t(v)] == 1 ? -1 : 1);
      const double off = (fitted.positions.row(v) - (1.03 - 0.2 * 0.24) * way).norm() - 0.24;
      REQUIRE(std::abs(off) < 0.03);
    }
}
