// SPDX-License-Identifier: GPL-3.0-or-later
#include "systems/clamped_poisson.h"

#include <Eigen/Dense>
#include <map>

#include "cases.h"
#include "catch.h"
#include "deform.h"
#include "dense_reference.h"
#include "mesh/geodesic_distances.h"

using namespace dd;
using test::Affine;
using test::surface;

namespace {

Eigen::Vector3d normal(const Mesh& mesh, const Positions& p, int j) {
  return test::triangle_normal(p, mesh.triangles, j);
}

/// Mean angle between the normals at edges between the handle's triangles and free ones, in
/// degrees, of a surface that is flat at rest.
double rim_angle(const test::Case& one, const Positions& deformed) {
  std::map<std::pair<int, int>, std::vector<int>> edges;
  for (int j = 0; j < one.mesh.triangle_count(); ++j)
    for (int k = 0; k < 3; ++k)
      edges[std::minmax(one.mesh.triangles(j, k), one.mesh.triangles(j, (k + 1) % 3))].push_back(j);
  const auto is_free = [&](int j) {
    for (int k = 0; k < 3; ++k)
      if (one.roles[one.mesh.triangles(j, k)] == kFree) return true;
    return false;
  };
  double sum = 0;
  int count = 0;
  for (const auto& [ends, two] : edges) {
    if (two.size() != 2 || is_free(two[0]) == is_free(two[1]) || one.roles[ends.first] != 0)
      continue;
    sum += std::acos(
        std::min(1.0, normal(one.mesh, deformed, two[0]).dot(normal(one.mesh, deformed, two[1]))));
    ++count;
  }
  return sum / count * 180 / std::acos(-1.0);
}

/// Mean slope of the triangles at the handle's one vertex, in degrees.
double slope_at_handle(const test::Case& one, const Positions& deformed) {
  double sum = 0;
  int count = 0;
  for (int j = 0; j < one.mesh.triangle_count(); ++j)
    for (int k = 0; k < 3; ++k)
      if (one.roles[one.mesh.triangles(j, k)] == 0) {
        sum += std::acos(std::abs(normal(one.mesh, deformed, j).z()));
        ++count;
      }
  return sum / count * 180 / std::acos(-1.0);
}

double measured(const test::Case& one, const UpdateOptions& options,
                double (*what)(const test::Case&, const Positions&)) {
  Deformer deformer(one.mesh, one.roles, 1, {});
  return what(one, surface(deformer, {one.motion}, options));
}

}  // namespace

TEST_CASE("rotations with clamped rims solve the fourth-order system, on dense matrices") {
  const Mesh mesh = test::rough_sphere(2, 0.1);
  const auto roles = test::roles_by_height(mesh, -0.5, 0.7);
  const Affine motion = test::rotation_about(0.5, {1, 0.3, 0}, {0, 0, 1}, {0.2, 0.1, 0.3});
  const Triangles& t = mesh.triangles;
  const int n = mesh.vertex_count(), m = mesh.triangle_count();

  const auto dense = test::dense_operators(mesh.positions, t);
  const auto linear = test::dense_transfer(mesh, roles, {motion}, false, true);
  Eigen::MatrixXd L = Eigen::MatrixXd::Zero(n, n), right = Eigen::MatrixXd::Zero(n, 3);
  std::vector<char> rim(size_t(n), 0);
  double area = 0;
  for (int j = 0; j < m; ++j) {  // triangles with a free vertex
    bool active = false;
    for (int k = 0; k < 3; ++k) active |= roles[t(j, k)] == kFree;
    if (!active) continue;
    const Eigen::MatrixXd G = dense.G.middleRows<3>(3 * j);
    const double a = dense.D(3 * j, 3 * j);
    L += a * G.transpose() * G;
    right +=
        a * G.transpose() *
        test::polar_rotation(test::deformation_gradient(linear.base, linear.base_deformed, t, j))
            .transpose();
    area += a;
    for (int k = 0; k < 3; ++k) rim[t(j, k)] |= roles[t(j, k)] != kFree;
  }
  // The clamp's length: 0.05 √area (usual()), times 1.5 at the rims, 0 from 2.5 lengths on.
  const double length = 0.05 * std::sqrt(area);
  const std::vector<double> distance = geodesic_distances(mesh, rim);
  Eigen::VectorXd weights = Eigen::VectorXd::Zero(n);
  for (int v = 0; v < n; ++v) {
    const double size = 1.5 * length - 0.6 * distance[v];
    if (size > 0 && (rim[v] || roles[v] == kFree)) weights[v] = size * size / dense.M(v, v);
  }
  const Eigen::MatrixXd bending = L * weights.asDiagonal();
  const Positions expected =
      test::dense_solve(L + bending * L, linear.surface, roles, right + bending * right);
  Deformer deformer(mesh, roles, 1, {});
  const Positions result = surface(deformer, {motion}, test::usual(0));
  CHECK(test::largest_difference(result, expected) < 1e-9);
  CHECK(test::largest_difference(result, linear.surface) > 1e-3);
}

TEST_CASE("the crease at a handle's rim shrinks with the edge length") {
  const test::Case coarse = test::pulled_disc(60, 0.13), fine = test::pulled_disc(120, 0.13);
  for (int refine : {0, 4}) {
    INFO(refine);
    const double at_60 = measured(coarse, test::usual(refine), rim_angle);
    const double at_120 = measured(fine, test::usual(refine), rim_angle);
    CHECK(at_120 < 7);
    CHECK(at_120 < 0.75 * at_60);
    CHECK(measured(fine, test::by(MethodKind::detail, true, refine), rim_angle) > 2 * at_120);
  }
}

TEST_CASE("a single vertex that is pulled stands on no spike") {
  const test::Case coarse = test::pulled_disc(60, 0), fine = test::pulled_disc(120, 0);
  for (int refine : {0, 4}) {
    INFO(refine);
    const double at_60 = measured(coarse, test::usual(refine), slope_at_handle);
    const double at_120 = measured(fine, test::usual(refine), slope_at_handle);
    CHECK(at_60 < 20);
    CHECK(at_120 < at_60);
    CHECK(measured(fine, test::by(MethodKind::detail, true, refine), slope_at_handle) > 45);
  }
}

TEST_CASE("clamped rims keep rest, rigid motion, scale and renumbering") {
  const auto plane = test::lifted_plane(61);
  Deformer deformer(plane.mesh, plane.roles, 1, {});
  Deformer held(plane.mesh, test::held_by_one(plane.roles), 1, {});
  const Affine motion = test::rotation_about(2.8, {1, 2, 0.5}, {0.2, 0, 0}, {0.3, -1, 2});
  Mesh scaled = plane.mesh;
  scaled.positions *= 1e4;
  Affine scaled_motion = plane.motion;
  scaled_motion.col(3) *= 1e4;
  Deformer large(scaled, plane.roles, 1, {});
  const auto renumbered = test::renumbered(plane.mesh, plane.roles);
  Deformer other(renumbered.mesh, renumbered.roles, 1, {});
  for (int refine : {0, 4}) {
    const UpdateOptions options = test::usual(refine);
    CHECK(test::largest_difference(surface(deformer, {test::identity()}, options),
                                   plane.mesh.positions) < 1e-12);
    CHECK(test::largest_difference(surface(held, {motion}, options),
                                   test::transformed(motion, plane.mesh.positions)) < 1e-9);
    const Positions expected = surface(deformer, {plane.motion}, options);
    CHECK(test::largest_difference(surface(large, {scaled_motion}, options) / 1e4, expected) <
          1e-8);
    const Positions result = surface(other, {plane.motion}, options);
    double worst = 0;
    for (int v = 0; v < plane.mesh.vertex_count(); ++v)
      worst = std::max(worst, (result.row(renumbered.new_of_old[v]) - expected.row(v)).norm());
    CHECK(worst < 1e-8);
  }
}

TEST_CASE("a clamp of almost no width changes nothing, also where far turns are refined in part") {
  // Beyond some angle the refined result is blended with the unrefined one: the same blend with
  // and without a clamp.
  const test::Case plane = test::lifted_plane(31);
  Deformer deformer(plane.mesh, plane.roles, 1, {});
  for (const double degrees : {100.0, 160.0, 200.0, 300.0}) {
    INFO(degrees);
    const test::Affine motion =
        test::rotation_about(degrees * 3.14159265358979 / 180, {1, 0, 0}, {0, 0, 0}, {0, 0, 0.3});
    UpdateOptions none = test::by(MethodKind::detail, true, 4), narrow = none;
    narrow.of_method.refined.rim_smoothing = 1e-7;
    const Positions creased = surface(deformer, {motion}, none);
    CHECK(test::largest_difference(creased, surface(deformer, {motion}, narrow)) < 1e-4);
    // One of the usual width does change the surface, so that it isn't left out at this angle.
    CHECK(test::largest_difference(creased, surface(deformer, {motion}, test::usual())) > 5e-3);
  }
}
