// SPDX-License-Identifier: GPL-3.0-or-later
#include "deform/mesh_part.h"

#include <cmath>

#include "cases.h"
#include "catch.h"
#include "deform.h"
#include "mesh/unit_box.h"

using namespace dd;
using test::Affine;
using test::Case;

namespace {

Affine turned_and_lifted() {
  Affine motion = test::rotation_about(0.8, {1, 2, 3}, {0, 0, 0}, {0, 0, 0});
  motion.col(3) << 0.02, 0.01, 0.08;
  return motion;
}

/// Free within a radius of a vertex, a fraction of the box; a quarter of that is the handle.
void add_patch(const Mesh& mesh, Index vertex, double radius, int handle, std::vector<int>& roles) {
  const double box = bounding_box_diagonal(mesh.positions);
  for (int v = 0; v < mesh.vertex_count(); ++v) {
    const double distance =
        (mesh.positions.row(v) - mesh.positions.row(vertex)).norm() / (radius * box);
    if (distance < 1) roles[size_t(v)] = distance < 0.25 ? handle : kFree;
  }
}

Index topmost(const Mesh& mesh) {
  Index top = 0;
  mesh.positions.col(2).maxCoeff(&top);
  return top;
}

/// All methods and outputs, skins and limbs, handles that turn freely.
std::vector<UpdateOptions> all_updates() {
  std::vector<UpdateOptions> all = {test::usual(),
                                    test::usual(8),
                                    test::solid(),
                                    test::by(MethodKind::detail),
                                    test::by(MethodKind::detail, false),
                                    test::by(MethodKind::variational),
                                    test::by(MethodKind::gradient),
                                    test::by(MethodKind::normal),
                                    test::by(MethodKind::volumes),
                                    test::by(MethodKind::examples),
                                    test::shown_base()};
  for (UpdateOptions free : {test::usual(), test::solid()}) {
    free.free = {1};
    all.push_back(free);
  }
  return all;
}

/// Binds a part and the whole; both have to give the same bits.
void check_bits(const Mesh& mesh, const std::vector<int>& roles, const BindOptions& options = {}) {
  BindOptions whole = options, part = options;
  whole.largest_part = 0;
  part.largest_part = 0.9;
  Deformer expected(mesh, roles, 1, whole), found(mesh, roles, 1, part);
  CHECK(found.bytes() < 0.9 * expected.bytes());
  CHECK(found.degenerate_triangles() == expected.degenerate_triangles());
  for (UpdateOptions update : all_updates()) {
    update.turns.clear();
    const Positions by_whole = test::surface(expected, {turned_and_lifted()}, update);
    CHECK(test::surface(found, {turned_and_lifted()}, update) == by_whole);
    CHECK((by_whole - mesh.positions).cwiseAbs().maxCoeff() > 0.005);
    CHECK(test::largest_difference(found.deformed_base(), expected.deformed_base()) < 1e-15);
  }
  CHECK(test::largest_difference(found.base(), expected.base()) < 1e-15);
  CHECK(found.findings(MethodKind::normal).unrepresented ==
        expected.findings(MethodKind::normal).unrepresented);
}

std::vector<int> patch_of(const Mesh& mesh, Index vertex, double radius) {
  std::vector<int> roles(size_t(mesh.vertex_count()), kFixed);
  add_patch(mesh, vertex, radius, 0, roles);
  return roles;
}

}  // namespace

TEST_CASE("a part of a mesh is bound to the bits of the whole: sheets, and tips of limbs") {
  const Case sheet = test::lifted_plane(151), cactus = test::subdivided(test::bent_cactus());
  const auto check = [&](Precision precision, Smoothness smoothness, Triangulation triangulation) {
    BindOptions options;
    options.precision = precision;
    options.smoothness = smoothness;
    options.triangulation = triangulation;
    check_bits(sheet.mesh, patch_of(sheet.mesh, 151 * 60 + 70, 0.05), options);
    check_bits(cactus.mesh, patch_of(cactus.mesh, topmost(cactus.mesh), 0.15), options);
  };
  check(Precision::single, Smoothness::thin_plate, Triangulation::delaunay);
  check(Precision::full, Smoothness::membrane, Triangulation::given);
  check(Precision::full, Smoothness::curvature_variation, Triangulation::delaunay);
}

TEST_CASE("a part of a mesh: stiffness, stiffness from the base, other meshes beside it") {
  const Case cactus = test::subdivided(test::bent_cactus());
  const std::vector<int> roles = patch_of(cactus.mesh, topmost(cactus.mesh), 0.15);
  BindOptions stiff;
  stiff.stiffness = Eigen::VectorXf::Zero(cactus.mesh.vertex_count());
  for (int v = 0; v < cactus.mesh.vertex_count(); v += 3) stiff.stiffness[v] = 0.7f;
  check_bits(cactus.mesh, roles, stiff);
  BindOptions on_base;
  on_base.base_metric = BaseMetric::base;
  check_bits(cactus.mesh, roles, on_base);

  // Inside out, with a second component that the handle holds a part of, a third one far away that
  // decides on the box, and a triangle without area in the patch.
  Mesh both = cactus.mesh;
  for (Index j = 0; j < both.triangles.rows(); ++j)
    std::swap(both.triangles(j, 1), both.triangles(j, 2));
  const Index n = both.positions.rows(), m = both.triangles.rows();
  both.positions.conservativeResize(3 * n, 3);
  both.positions.middleRows(n, n) =
      both.positions.topRows(n).rowwise() + Eigen::RowVector3d(2, 0, 0);
  both.positions.bottomRows(n) = both.positions.topRows(n).rowwise() + Eigen::RowVector3d(3, 9, 1);
  both.triangles.conservativeResize(3 * m, 3);
  both.triangles.middleRows(m, m) = both.triangles.topRows(m).array() + int(n);
  both.triangles.bottomRows(m) = both.triangles.topRows(m).array() + int(2 * n);
  std::vector<int> of_both = roles;
  of_both.resize(size_t(3 * n), kFixed);
  of_both[size_t(n + n / 2)] = 0;
  const Index top = topmost(cactus.mesh);
  for (Index j = 0; j < m; ++j) {
    const auto corners = both.triangles.row(j);
    if (of_both[size_t(corners[0])] != kFree || corners[0] == top) continue;
    both.positions.row(corners[1]) = both.positions.row(corners[0]);
    break;
  }
  check_bits(both, of_both);
}

TEST_CASE("a part of a mesh: what is outside of it stays, in floats, too") {
  const Case sheet = test::lifted_plane(151);
  const std::vector<int> roles = patch_of(sheet.mesh, 151 * 60 + 70, 0.05);
  Deformer deformer(sheet.mesh, roles, 1, {});
  const Affine motion = turned_and_lifted();
  const Index n = sheet.mesh.vertex_count();
  for (const bool positions : {false, true}) {
    std::vector<float> out(size_t(4 * n), -7.0f);
    deformer.update_to(out.data(), 4, positions, motion.data(), test::usual());
    for (Index v = 0; v < n; ++v) {
      CHECK(out[size_t(4 * v + 3)] == -7.0f);
      if (roles[size_t(v)] != kFixed) continue;
      for (int c = 0; c < 3; ++c) {
        const auto expected = positions ? static_cast<float>(sheet.mesh.positions(v, c)) : 0.0f;
        CHECK(out[size_t(4 * v + c)] == expected);
      }
    }
  }
}

TEST_CASE("a part of a mesh: its errors are about vertices and triangles of the mesh") {
  const Case sheet = test::lifted_plane(151);
  const Region region = make_region(sheet.mesh, patch_of(sheet.mesh, 151 * 60 + 70, 0.05), 1);
  CHECK(!MeshPart::make(sheet.mesh, region, 0.001));
  const auto part = MeshPart::make(sheet.mesh, region, 0.9);
  REQUIRE(part);
  CHECK(part->region.free_count() == region.free_count());
  const int vertex = part->region.free[5];
  const Error of_vertex(Status::numeric, {Subject::vertex, vertex}, "is lost", Remedy::none,
                        {vertex, vertex + 1});
  CHECK(part->of_whole(of_vertex).subject().index == region.free[5]);
  CHECK(part->of_whole(of_vertex).vertices()[0] == region.free[5]);
  const Error of_handle(Status::numeric, {Subject::handle, 0}, "is lost", Remedy::none);
  CHECK(part->of_whole(of_handle).subject().index == 0);
  for (size_t j = 0; j < part->triangles.size(); ++j)
    for (int k = 0; k < 3; ++k)
      CHECK(part->vertices[size_t(part->mesh.triangles(Index(j), k))] ==
            sheet.mesh.triangles(part->triangles[j], k));
}
