// SPDX-License-Identifier: GPL-3.0-or-later
#include "reconstruction/refinement.h"

#include <Eigen/Dense>

#include "cases.h"
#include "catch.h"
#include "deform.h"
#include "dense_reference.h"
#include "mesh/measures.h"
#include "mesh/unit_box.h"

using namespace dd;
using test::Affine;
using test::surface;

namespace {

UpdateOptions refined(int iterations) { return test::by(MethodKind::detail, true, iterations); }

std::vector<char> free_vertices(const test::Case& one) {
  std::vector<char> free;
  for (int role : one.roles) free.push_back(role == kFree);
  return free;
}

double active_size(const Mesh& mesh, const std::vector<int>& roles) {
  double area = 0;
  for (Index j = 0; j < mesh.triangles.rows(); ++j) {
    const auto t = mesh.triangles.row(j);
    if (roles[t[0]] != kFree && roles[t[1]] != kFree && roles[t[2]] != kFree) continue;
    const Eigen::RowVector3d a = mesh.positions.row(t[0]), b = mesh.positions.row(t[1]),
                             c = mesh.positions.row(t[2]);
    area += 0.5 * (b - a).cross(c - a).norm();
  }
  return std::sqrt(area);
}

struct Pass {
  double relaxation, smoothing;
};

/// The iteration on dense matrices: means of rotations by singular value decomposition and nine
/// smoothed columns where the core has quaternions.
Positions dense_refinement(const Mesh& mesh, const std::vector<int>& roles, Positions deformed,
                           const std::vector<Pass>& passes, double length) {
  const auto dense = test::dense_operators(mesh.positions, mesh.triangles);
  const int n = mesh.vertex_count(), m = mesh.triangle_count();
  const auto is_held = [&](int j) {
    const auto t = mesh.triangles.row(j);
    return roles[t[0]] != kFree && roles[t[1]] != kFree && roles[t[2]] != kFree;
  };
  std::vector<int> free, constrained;
  for (int v = 0; v < n; ++v) (roles[v] == kFree ? free : constrained).push_back(v);
  std::vector<char> has_held(size_t(n), 0);
  for (int j = 0; j < m; ++j)
    for (int k = 0; k < 3; ++k) has_held[mesh.triangles(j, k)] |= is_held(j);
  const Eigen::MatrixXd system = dense.M + length * length * dense.L;
  for (const Pass& pass : passes) {
    Eigen::MatrixXd given = Eigen::MatrixXd::Zero(n, 9);
    for (int j = 0; j < m; ++j) {
      const Eigen::Matrix3d R = test::polar_rotation(
          test::deformation_gradient(mesh.positions, deformed, mesh.triangles, j));
      for (int k = 0; k < 3; ++k) {
        const int v = mesh.triangles(j, k);
        if (has_held[v] && !is_held(j)) continue;
        given.row(v) += dense.D(3 * j, 3 * j) * Eigen::Map<const Eigen::RowVectorXd>(R.data(), 9);
      }
    }
    const auto project = [](Eigen::Ref<Eigen::RowVectorXd, 0, Eigen::InnerStride<>> row) {
      Eigen::Matrix3d R;
      for (int k = 0; k < 9; ++k) R.data()[k] = row[k];
      R = test::polar_rotation(R);
      for (int k = 0; k < 9; ++k) row[k] = R.data()[k];
    };
    for (int v = 0; v < n; ++v) project(given.row(v));
    const Eigen::MatrixXd right = (dense.M * given)(free, kAllIndices) -
                                  system(free, constrained) * given(constrained, kAllIndices);
    const Eigen::MatrixXd smoothed = system(free, free).fullPivLu().solve(right);
    const Eigen::MatrixXd before = given(free, kAllIndices);
    given(free, kAllIndices) = before + pass.smoothing * (smoothed - before);
    Eigen::MatrixXd gradients(3 * m, 3);
    for (int j = 0; j < m; ++j) {
      const auto t = mesh.triangles.row(j);
      const Eigen::RowVectorXd sum = given.row(t[0]) + given.row(t[1]) + given.row(t[2]);
      const Eigen::Matrix3d R = test::polar_rotation(Eigen::Map<const Eigen::Matrix3d>(sum.data()));
      gradients.middleRows<3>(3 * j) = R.transpose();
    }
    deformed += pass.relaxation * (test::dense_solve(dense.L, deformed, roles,
                                                     dense.G.transpose() * dense.D * gradients) -
                                   deformed);
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
  // Passes of the core at these counts. Means of quaternions and of matrices agree to the third
  // order of the rotations' differences: hence 0.02 of the motion.
  const std::vector<Pass> four{{3.25, 0}, {1.45, 1}, {3.25, 1}, {1, 1}};
  const std::vector<Pass> six{{4, 1}, {1, 1}, {2, 1}, {1, 1}, {2, 0.8}, {1, 0.5}};
  for (const auto& passes : {four, six})
    for (const double length : {0.009, 0.1}) {
      UpdateOptions options = refined(static_cast<int>(passes.size()));
      options.of_method.refined.rotation_smoothing = length;
      const Positions expected =
          dense_refinement(mesh, roles, start, passes, length * active_size(mesh, roles));
      const Positions result = surface(deformer, {motion}, options);
      const double moved = test::largest_difference(expected, start);
      CHECK(moved > 0.01);
      CHECK(test::largest_difference(result, expected) < 0.02 * moved);
    }
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

TEST_CASE("refined: the result depends on the pose alone, and a drag in small moves has no jumps") {
  auto cylinder = test::bent_cylinder();
  Deformer deformer(cylinder.mesh, cylinder.roles, 1, {});
  const Positions last = test::dragged(
      deformer, 100, [](double way) { return test::bent_cylinder(120 * way).motion; }, refined(4));
  Deformer fresh(cylinder.mesh, cylinder.roles, 1, {});
  CHECK(test::largest_difference(surface(fresh, {cylinder.motion}, refined(4)), last) == 0);
}

TEST_CASE("refined: no fold and little stretch on the four cases of the survey, at any density",
          "[large]") {
  const double limits[] = {0.027, 0.09, 0.075, 0.057};
  int number = 0;
  for (test::Case one : test::survey_cases()) {
    INFO(one.name);
    double coarse = 0;
    for (int level : {0, 1}) {
      INFO("subdivided " << level);
      Deformer deformer(one.mesh, one.roles, 1, {});
      const auto measured = [&](int iterations) {
        return measure(one.mesh, surface(deformer, {one.motion}, test::usual(iterations)),
                       free_vertices(one));
      };
      const Measures linear = measured(0), four = measured(4), eight = measured(8);
      CHECK(four.new_intersecting_pairs == 0);
      CHECK(eight.new_intersecting_pairs == 0);
      CHECK(four.stretch < limits[number]);
      CHECK(four.stretch < 0.95 * linear.stretch);
      CHECK(eight.stretch <= four.stretch);
      if (level == 0) coarse = four.stretch;
      CHECK(std::abs(four.stretch - coarse) < 0.1 * coarse);
      if (level == 0) one = test::subdivided(one);
    }
    ++number;
  }
}

TEST_CASE("refined: the density of a part doesn't decide its shape") {
  // The bar with every vertex of the even one, and eight times as dense in its upper half.
  const test::Case even = test::twisted_bar();
  const auto mixed = [&] {
    test::Case made = even;
    made.mesh = test::tube(30 + 8 * 30 + 1, 96, [&](double u, double v) {
      const double rings = u * (30 + 8 * 30),
                   height = rings < 30 ? rings / 60 : 0.5 + (rings - 30) / 480;
      const double s = 4 * v / std::acos(-1.0), side = std::floor(s / 2), along = s - 2 * side - 1;
      const Eigen::Vector2d corner =
          Eigen::Rotation2Dd(side * std::acos(-1.0) / 2) * Eigen::Vector2d(0.07, 0.07 * along);
      return Eigen::RowVector3d(corner.x(), corner.y(), 1.2 * height);
    });
    made.roles = test::ends_held(made.mesh, 0.1, 0.9);
    return made;
  }();
  Deformer coarse(even.mesh, even.roles, 1, {}), uneven(mixed.mesh, mixed.roles, 1, {});
  const Positions expected = surface(coarse, {even.motion}, test::usual());
  const Positions result = surface(uneven, {even.motion}, test::usual());
  double worst = 0;
  for (int ring = 0; ring <= 60; ++ring)
    for (int k = 0; k < 96; ++k) {
      const int same = ring <= 30 ? ring : 30 + 8 * (ring - 30);
      worst = std::max(worst, (result.row(96 * same + k) - expected.row(96 * ring + k)).norm());
    }
  CHECK(worst < 0.01 * bounding_box_diagonal(even.mesh.positions));
  CHECK(measure(mixed.mesh, result, free_vertices(mixed)).new_intersecting_pairs == 0);
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
