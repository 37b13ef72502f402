// SPDX-License-Identifier: GPL-3.0-or-later
#include "surface/refinement.h"

#include <Eigen/Dense>

#include "cases.h"
#include "catch.h"
#include "deform.h"
#include "dense_reference.h"
#include "mesh/measures.h"

using namespace dd;
using test::Affine;
using test::surface;

namespace {

UpdateOptions refined(int iterations) { return test::by(MethodKind::transfer, true, iterations); }

/// PAPER's refinement on dense matrices: means of rotations by singular value decomposition where
/// the core takes quaternions.
Positions dense_refinement(const Mesh& mesh, const std::vector<int>& roles, Positions deformed,
                           int iterations, int passes) {
  const auto dense = test::dense_operators(mesh.positions, mesh.triangles);
  const int n = mesh.vertex_count(), m = mesh.triangle_count();
  for (int iteration = 0; iteration < iterations; ++iteration) {
    std::vector<Eigen::Matrix3d> of_triangle;
    for (int j = 0; j < m; ++j)
      of_triangle.push_back(test::polar_rotation(
          test::deformation_gradient(mesh.positions, deformed, mesh.triangles, j)));
    for (int pass = 0; pass < passes; ++pass) {
      std::vector<Eigen::Matrix3d> of_vertex(size_t(n), Eigen::Matrix3d::Zero());
      for (int j = 0; j < m; ++j)
        for (int k = 0; k < 3; ++k)
          of_vertex[mesh.triangles(j, k)] += dense.D(3 * j, 3 * j) * of_triangle[j];
      for (auto& R : of_vertex) R = test::polar_rotation(R);
      for (int j = 0; j < m; ++j) {
        const auto corner = mesh.triangles.row(j);
        if (roles[corner[0]] != kFree && roles[corner[1]] != kFree && roles[corner[2]] != kFree)
          continue;
        of_triangle[j] = test::polar_rotation(of_vertex[corner[0]] + of_vertex[corner[1]] +
                                              of_vertex[corner[2]]);
      }
    }
    Eigen::MatrixXd gradients(3 * m, 3);
    for (int j = 0; j < m; ++j) gradients.middleRows<3>(3 * j) = of_triangle[j].transpose();
    deformed =
        test::dense_solve(dense.L, deformed, roles, dense.G.transpose() * dense.D * gradients);
  }
  return deformed;
}

}  // namespace

TEST_CASE("refinement follows the same iteration on dense matrices") {
  const Mesh mesh = test::rough_sphere(2, 0.1);
  const auto roles = test::roles_by_height(mesh, -0.5, 0.7);
  const Affine motion = test::rotation_about(0.5, {1, 0.3, 0}, {0, 0, 1}, {0.2, 0.1, 0.3});
  Deformer deformer(mesh, roles, 1, {});
  const Positions start = surface(deformer, {motion});
  // Means of quaternions and of matrices agree to the third order of the rotations' differences.
  const Positions expected = dense_refinement(mesh, roles, start, 3, 6);
  const Positions result = surface(deformer, {motion}, refined(3));
  const double moved = test::largest_difference(expected, start);
  CHECK(moved > 0.01);
  CHECK(test::largest_difference(result, expected) < 0.02 * moved);
}

TEST_CASE("refined: rest, rigid motion, scale and renumbering are kept") {
  const auto plane = test::lifted_plane(61);
  const Mesh& mesh = plane.mesh;
  Deformer deformer(mesh, plane.roles, 1, {});
  CHECK(test::largest_difference(surface(deformer, {test::identity()}, refined(4)),
                                 mesh.positions) < 1e-10);

  const Affine motion = test::rotation_about(2.8, {1, 2, 0.5}, {0.2, 0, 0}, {0.3, -1, 2});
  Deformer held(mesh, test::held_by_one(plane.roles), 1, {});
  CHECK(test::largest_difference(surface(held, {motion}, refined(4)),
                                 test::transformed(motion, mesh.positions)) < 1e-9);

  const Positions expected = surface(deformer, {plane.motion}, refined(4));
  Mesh scaled = mesh;
  scaled.positions *= 1e4;
  Affine scaled_motion = plane.motion;
  scaled_motion.col(3) *= 1e4;
  Deformer large(scaled, plane.roles, 1, {});
  CHECK(test::largest_difference(surface(large, {scaled_motion}, refined(4)) / 1e4, expected) <
        1e-9);

  const auto renumbered = test::renumbered(mesh, plane.roles);
  Deformer other(renumbered.mesh, renumbered.roles, 1, {});
  const Positions result = surface(other, {plane.motion}, refined(4));
  double worst = 0;
  for (int v = 0; v < mesh.vertex_count(); ++v)
    worst = std::max(worst, (result.row(renumbered.new_of_old[v]) - expected.row(v)).norm());
  CHECK(worst < 1e-9);
}

TEST_CASE("refined: the pose alone decides, and a drag in small moves has no jumps") {
  auto cylinder = test::bent_cylinder();
  Deformer deformer(cylinder.mesh, cylinder.roles, 1, {});
  const int moves = 100;
  Positions last = cylinder.mesh.positions, before_last = last;
  double longest_step = 0, shortest_step = 1e9;
  for (int k = 1; k <= moves; ++k) {
    const auto motion = test::bent_cylinder(120.0 * k / moves).motion;
    const Positions now = surface(deformer, {motion}, refined(4));
    const double step = (now - last).rowwise().norm().maxCoeff();
    longest_step = std::max(longest_step, step);
    shortest_step = std::min(shortest_step, step);
    last = now;
  }
  // The handle's own vertices move by nearly the same in each.
  CHECK(longest_step < 2 * shortest_step);
  Deformer fresh(cylinder.mesh, cylinder.roles, 1, {});
  CHECK(test::largest_difference(surface(fresh, {cylinder.motion}, refined(4)), last) == 0);
}

TEST_CASE("refined: no fold and little stretch on the four cases of the survey") {
  const double limits[] = {0.03, 0.12, 0.09, 0.065};
  int number = 0;
  for (const test::Case& one : test::survey_cases()) {
    INFO(one.name);
    Deformer deformer(one.mesh, one.roles, 1, {});
    std::vector<char> free;
    for (int role : one.roles) free.push_back(role == kFree);
    const auto measured = [&](int iterations) {
      return measure(one.mesh, surface(deformer, {one.motion}, refined(iterations)), free);
    };
    const Measures linear = measured(0), four = measured(4), eight = measured(8);
    CHECK(four.new_intersecting_pairs == 0);
    CHECK(eight.new_intersecting_pairs == 0);
    CHECK(four.stretch < limits[number++]);
    CHECK(four.stretch < 0.95 * linear.stretch);
    CHECK(eight.stretch <= four.stretch);
  }
}

TEST_CASE("refined: degenerate triangles and loose parts stay finite and rigid") {
  Mesh mesh = test::bumpy_plane(31, 4);
  const Index n = mesh.positions.rows(), m = mesh.triangles.rows();
  const int a = 15 * 31 + 15;
  mesh.positions.conservativeResize(n + 1, 3);
  mesh.positions.row(n) = mesh.positions.row(a);
  mesh.triangles.conservativeResize(m + 2, 3);
  mesh.triangles.row(m) << a, a + 31, int(n);
  mesh.triangles.row(m + 1) << a, a + 62, int(n);
  auto roles = test::strip_roles(31, 31, 4, 27);
  roles.push_back(kFree);
  Deformer deformer(mesh, test::held_by_one(roles), 1, {});
  const Affine motion = test::rotation_about(0.7, {0, 1, 2}, {0, 0, 0}, {1, 0, 0});
  CHECK(test::largest_difference(surface(deformer, {motion}, refined(4)),
                                 test::transformed(motion, mesh.positions)) < 1e-9);
  Affine flat = Affine::Zero();
  CHECK(surface(deformer, {flat}, refined(4)).allFinite());
}
