// SPDX-License-Identifier: GPL-3.0-or-later
// Triangles without area, at rest or after a motion: they have no rotation of their own.
#include <Eigen/Dense>

#include "catch.h"
#include "deform.h"
#include "deform/mesh_transfer.h"
#include "limbs.h"

using namespace dd;
using test::largest_difference;
using test::surface;

namespace {

/// Triangles of length 1 and width 1e-4: too thin for a rotation of their own.
Mesh ribbon() {
  Mesh mesh = test::grid(21, 3, [](double, double) { return 0.0; });
  mesh.positions.col(0) *= 20;
  mesh.positions.col(1) *= 2 * 1e-4;
  return mesh;
}

std::vector<int> ribbon_roles() { return test::strip_roles(21, 3, 2, 19); }

}  // namespace

TEST_CASE("a ribbon of very thin triangles rests when transferred onto itself") {
  const Mesh mesh = ribbon();
  for (bool rotation_only : {false, true}) {
    MeshTransfer transfer(mesh, mesh, identity_correspondence(mesh, mesh), {});
    CHECK(largest_difference(transfer.apply(mesh.positions, rotation_only), mesh.positions) <
          1e-12 * 20);
  }
}

TEST_CASE("EXAMPLES: a ribbon of very thin triangles rests with its examples") {
  const Mesh mesh = ribbon();
  Deformer deformer(mesh, ribbon_roles(), 1, test::with({mesh.positions}));
  for (const UpdateOptions& options : {test::posed(), test::posed_by({1})})
    CHECK(largest_difference(surface(deformer, {test::identity()}, options), mesh.positions) <
          1e-12 * 20);
}

TEST_CASE("an outside base that is a line leaves the surface at rest") {
  const Mesh mesh = test::tube(21, 12, [](double u, double v) {
    // Not symmetric about the line, so that a turn about it would show.
    const double radius = 0.2 + 0.1 * u * std::cos(v);
    return Eigen::RowVector3d(radius * std::cos(v) + 0.1, radius * std::sin(v), u);
  });
  BindOptions options;
  options.base = mesh.positions;
  options.base.leftCols<2>().setZero();
  const std::vector<int> roles(static_cast<size_t>(mesh.vertex_count()), kFree);
  Deformer deformer(mesh, roles, 0, options);
  for (int refine : {0, 4}) {
    const Positions offsets =
        deformer.update(nullptr, test::by(MethodKind::detail, true, refine), &options.base);
    CHECK(offsets.cwiseAbs().maxCoeff() < 1e-12);
  }
}
