// SPDX-License-Identifier: GPL-3.0-or-later
#include "base/mixed_bilaplacian.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/bound_surface.h"
#include "cases.h"
#include "catch.h"
#include "deform.h"
#include "dense_reference.h"

using namespace dd;
using test::Affine;

namespace {

BindOptions by_mixed(int threads = 2) {
  BindOptions options;
  options.precision = Precision::single;
  options.threads = threads;
  options.large_from = 0;
  options.largest_contraction = 1;
  return options;
}

BindOptions by_factor_of_k() {
  BindOptions options = by_mixed();
  options.large_from = std::numeric_limits<int>::max();
  return options;
}

struct OfBase {
  OfBase(const Mesh& mesh, const std::vector<int>& roles, int handles, const BindOptions& options)
      : pool(options.threads),
        region(make_region(mesh, roles, handles)),
        surface(mesh, region, options, pool, {}) {}

  RowMatrix basis() const {
    RowMatrix space;
    return surface.extension.basis_functions(space);
  }

  ThreadPool pool;
  Region region;
  BoundSurface surface;
};

/// A surface and its handles whose coarse mesh is small enough.
struct Held {
  const char* name;
  Mesh mesh;
  std::vector<int> roles;
  int handles = 1;
};

/// Vertices near the given ones, within a fraction of the box, become of a handle each.
void add_handle(Held& scene, const Eigen::RowVector3d& centre, double radius) {
  const double box = bounding_box_diagonal(scene.mesh.positions);
  for (int v = 0; v < scene.mesh.vertex_count(); ++v)
    if ((scene.mesh.positions.row(v) - centre).norm() < radius * box)
      scene.roles[size_t(v)] = scene.handles;
  ++scene.handles;
}

std::vector<Held> held_surfaces() {
  std::vector<Held> all;
  all.push_back({"strip", test::bumpy_plane(201), test::strip_roles(201, 201, 23, 178)});
  const Mesh ball = test::rough_sphere(7, 0.05);
  all.push_back({"sphere", ball, test::roles_by_height(ball, -0.6, 0.7)});
  // Jagged rims, and a handle of one vertex.
  Held painted{"painted", ball, test::roles_by_height(ball, -0.5, 0.8)};
  for (int v = 0; v < ball.vertex_count(); ++v) {
    const auto p = ball.positions.row(v);
    const bool held = p[2] + 0.06 * std::sin(31 * p[0]) * std::sin(47 * p[1]) < -0.5;
    if (painted.roles[size_t(v)] != 0) painted.roles[size_t(v)] = held ? kFixed : kFree;
  }
  add_handle(painted, {1, 0, 0}, 0.05);
  int single = 0;
  (ball.positions.rowwise() - Eigen::RowVector3d(0, -1, 0)).rowwise().norm().minCoeff(&single);
  painted.roles[size_t(single)] = painted.handles++;
  all.push_back(std::move(painted));
  // Nothing fixed, so that all handles together move rigidly.
  Held held{"held by handles", ball, test::roles_by_height(ball, -2, 0.7)};
  add_handle(held, {0, 0, -1}, 0.2);
  all.push_back(std::move(held));
  return all;
}

}  // namespace

TEST_CASE("the base by two Poisson solves is that of K's factor") {
  for (const Held& scene : held_surfaces()) {
    INFO(scene.name);
    const OfBase mixed(scene.mesh, scene.roles, scene.handles, by_mixed());
    const OfBase factored(scene.mesh, scene.roles, scene.handles, by_factor_of_k());
    REQUIRE(mixed.surface.contraction);
    REQUIRE(!factored.surface.contraction);
    const double box = bounding_box_diagonal(scene.mesh.positions);
    CHECK(test::largest_difference(mixed.surface.base, factored.surface.base) < 1e-5 * box);
    CHECK(mixed.surface.base != factored.surface.base);
    CHECK(test::largest_difference(mixed.surface.base, scene.mesh.positions) > 1e-3 * box);
    const RowMatrix expected = factored.basis(), found = mixed.basis();
    REQUIRE(found.cols() == expected.cols());
    for (Index c = 0; c < expected.cols(); ++c)
      CHECK((found.col(c) - expected.col(c)).cwiseAbs().maxCoeff() <
            5e-5 * expected.col(c).cwiseAbs().maxCoeff());
  }
}

TEST_CASE("the base by two Poisson solves has the least energy of a plate") {
  const Held scene = held_surfaces().front();
  const OfBase mixed(scene.mesh, scene.roles, 1, by_mixed());
  const OfBase factored(scene.mesh, scene.roles, 1, by_factor_of_k());
  const SurfaceOperators& operators = mixed.surface.operators;
  const auto energy = [&](const Positions& q) {
    const RowMatrix flux = operators.laplacian * RowMatrix(q);
    double sum = 0;
    for (int v = 0; v < scene.mesh.vertex_count(); ++v) {
      bool moves = false;  // elsewhere the energy doesn't depend on the base
      for (SparseMatrix::InnerIterator it(operators.laplacian, v); it; ++it)
        moves |= mixed.region.row[size_t(it.row())] >= 0;
      if (moves) sum += flux.row(v).squaredNorm() / operators.masses[v];
    }
    return sum;
  };
  const double least = energy(factored.surface.base);
  CHECK(energy(mixed.surface.base) == Approx(least).epsilon(1e-5));
  Positions other = mixed.surface.base;
  other.row(mixed.region.free[5000]) += Eigen::RowVector3d(0, 0, 1e-3);
  CHECK(energy(other) > 1.001 * least);
}

TEST_CASE("poses by two Poisson solves are those by K's factor, for any number of threads") {
  Affine motion = test::rotation_about(0.8, {1, 2, 3}, {0, 0, 0}, {0, 0, 0});
  motion.col(3) << 0.1, 0.05, 0.2;
  const std::vector<Held> surfaces = held_surfaces();
  for (const Held& scene : {surfaces.front(), surfaces.back()}) {
    INFO(scene.name);
    std::vector<Affine> motions(size_t(scene.handles), test::identity());
    motions[0] = motion;
    Deformer factored(scene.mesh, scene.roles, scene.handles, by_factor_of_k());
    Deformer one(scene.mesh, scene.roles, scene.handles, by_mixed(1));
    Deformer three(scene.mesh, scene.roles, scene.handles, by_mixed(3));
    const double box = bounding_box_diagonal(scene.mesh.positions);
    UpdateOptions without_clamps = test::usual();  // which are approximated: CoarseClamps
    without_clamps.of_method.refined.rim_smoothing = 0;
    for (const UpdateOptions& how : {without_clamps, test::by(MethodKind::detail),
                                     test::by(MethodKind::variational), test::shown_base()}) {
      const Positions expected = test::surface(factored, motions, how);
      const Positions found = test::surface(one, motions, how);
      // Without refinement, rotations of triangles that are thin in the base decide on vertices.
      const bool by_triangles =
          how.method == MethodKind::detail && how.of_method.refined.iterations == 0;
      Eigen::VectorXd apart = (found - expected).rowwise().norm() / box;
      std::sort(apart.begin(), apart.end());
      CHECK(apart[by_triangles ? apart.size() * 99 / 100 : apart.size() - 1] < 2e-5);
      CHECK(test::largest_difference(found, scene.mesh.positions) > 0.05 * box);
      CHECK(test::surface(three, motions, how) == found);
    }
    const std::vector<Affine> still(size_t(scene.handles), test::identity());
    CHECK(test::largest_difference(test::surface(one, still, test::usual()), scene.mesh.positions) <
          1e-12 * box);
  }
}

TEST_CASE("where two Poisson solves don't pay or aren't exact, K is factored") {
  const auto bits_of = [](const Mesh& mesh, const std::vector<int>& roles, BindOptions options) {
    const OfBase mixed(mesh, roles, 1, options);
    options.large_from = std::numeric_limits<int>::max();
    const OfBase factored(mesh, roles, 1, options);
    CHECK(mixed.surface.base == factored.surface.base);
    CHECK(mixed.basis() == factored.basis());
  };
  const Mesh ball = test::rough_sphere(5, 0.05);
  const std::vector<int> roles = test::roles_by_height(ball, -0.6, 0.7);
  BindOptions other = by_mixed();
  other.largest_contraction = BindOptions{}.largest_contraction;
  bits_of(ball, roles, other);  // its coarse mesh is as large
  const Held scene = held_surfaces().front();
  other = by_mixed();
  other.smoothness = Smoothness::membrane;
  bits_of(scene.mesh, scene.roles, other);
  other = by_mixed();
  other.precision = Precision::full;
  bits_of(scene.mesh, scene.roles, other);
  other = by_mixed();
  other.stiffness = Eigen::VectorXf::Zero(scene.mesh.vertex_count());
  for (int v = 0; v < scene.mesh.vertex_count(); v += 3) other.stiffness[v] = 0.7f;
  bits_of(scene.mesh, scene.roles, other);
  other = by_mixed();
  other.large_from = 1 << 20;
  bits_of(scene.mesh, scene.roles, other);
}
