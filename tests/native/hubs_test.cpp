// SPDX-License-Identifier: GPL-3.0-or-later
// Hubs: vertices of many neighbours, all of which the bi-Laplacian couples with one another.
#include "base/base_surface.h"
#include "deform.h"
#include "dense_reference.h"
#include "systems/handle_solve.h"
#include "systems/polyharmonic_system.h"

using namespace dd;

namespace {

const double kPi = std::acos(-1.0);

/// Rings of many sides about a pole, vertex 0; closed by a second pole, the last vertex, or open.
Mesh rings_about_poles(int sides, int rings, bool closed) {
  Mesh mesh;
  const int poles = closed ? 2 : 1;
  mesh.positions.resize(sides * rings + poles, 3);
  mesh.positions.row(0) << 0, 0, 1;
  if (closed) mesh.positions.bottomRows(1) << 0, 0, -1;
  for (int i = 0; i < rings; ++i)
    for (int j = 0; j < sides; ++j) {
      const double u = kPi * (i + 1.0) / (closed ? rings + 1 : 2 * rings), v = 2 * kPi * j / sides;
      const double radius = std::sin(u) * (1 + 0.1 * std::cos(3 * v));
      mesh.positions.row(1 + i * sides + j) << radius * std::cos(v), radius * std::sin(v),
          std::cos(u) + 0.05 * std::sin(2 * v) * std::sin(u);
    }
  mesh.triangles.resize(sides * (2 * rings - 2 + poles), 3);
  int t = 0;
  for (int j = 0; j < sides; ++j) {
    const int next = (j + 1) % sides;
    mesh.triangles.row(t++) << 0, 1 + j, 1 + next;
    for (int i = 0; i + 1 < rings; ++i) {
      const int a = 1 + i * sides, b = a + sides;
      mesh.triangles.row(t++) << a + j, b + j, b + next;
      mesh.triangles.row(t++) << a + j, b + next, a + next;
    }
    const int last = 1 + (rings - 1) * sides;
    if (closed) mesh.triangles.row(t++) << sides * rings + 1, last + next, last + j;
  }
  return mesh;
}

struct HubCase {
  const char* name;
  Mesh mesh;
  std::vector<int> roles;
};

/// Poles of 40 neighbours; a ring is fixed in one half, a handle in the other.
std::vector<HubCase> cases() {
  const int sides = 40;
  const auto held_at_ring = [&](int rings, bool closed, int ring) {
    HubCase made{"", rings_about_poles(sides, rings, closed), {}};
    made.roles.assign(static_cast<size_t>(made.mesh.vertex_count()), kFree);
    for (int j = 0; j < sides; ++j) made.roles[1 + ring * sides + j] = j < sides / 2 ? kFixed : 0;
    return made;
  };
  std::vector<HubCase> all{held_at_ring(5, false, 4), held_at_ring(5, false, 4),
                           held_at_ring(5, true, 2)};
  all[0].name = "a free pole";
  all[1].name = "a pole in a handle";
  all[1].roles[0] = 0;
  // Without the curvature at both poles, moving them against each other would cost nothing.
  all[2].name = "two free poles";
  return all;
}

constexpr int kFew = 20;  // neighbours of a vertex that is no hub

}  // namespace

TEST_CASE("the energy as a sparse part and one of low rank for hubs is the same matrix") {
  for (const HubCase& one : cases())
    for (Smoothness smoothness : {Smoothness::thin_plate, Smoothness::curvature_variation}) {
      INFO(one.name << ", order " << static_cast<int>(smoothness));
      const Region region = make_region(one.mesh, one.roles, 1);
      const auto operators = surface_operators(one.mesh.positions, one.mesh.triangles);
      const Eigen::MatrixXd full = energy_block(operators, region, smoothness).sparse;
      const EnergyBlock block = energy_block(operators, region, smoothness, kFew);
      REQUIRE(block.vectors.cols() > 0);
      const Eigen::MatrixXd vectors = block.vectors;
      const Eigen::MatrixXd sum =
          Eigen::MatrixXd(block.sparse) + vectors * block.core * vectors.transpose();
      CHECK((sum - full).cwiseAbs().maxCoeff() < 1e-14 * full.cwiseAbs().maxCoeff());
      // Entries of vertices that aren't poles: the 7 × 7 within three edges, and the poles.
      for (int r = 0; r < region.free_count(); ++r)
        if (operators.laplacian.col(region.free[r]).nonZeros() <= kFew)
          CHECK(block.sparse.col(r).nonZeros() <= 7 * 7 + 2);
    }
}

TEST_CASE("a surface with hubs is solved for as by a dense matrix") {
  for (const HubCase& one : cases()) {
    const auto dense = test::dense_operators(one.mesh.positions, one.mesh.triangles);
    const Eigen::MatrixXd step = dense.M.inverse() * dense.L;
    const Eigen::MatrixXd none = Eigen::MatrixXd::Zero(one.mesh.vertex_count(), 3);
    const Region region = make_region(one.mesh, one.roles, 1);
    const auto operators = surface_operators(one.mesh.positions, one.mesh.triangles);
    Eigen::MatrixXd energy = dense.L;
    for (Smoothness smoothness :
         {Smoothness::membrane, Smoothness::thin_plate, Smoothness::curvature_variation}) {
      INFO(one.name << ", order " << static_cast<int>(smoothness));
      const EnergyBlock block = energy_block(operators, region, smoothness, kFew);
      const PolyharmonicSystem bending(operators, region, smoothness, block, {});
      const Positions q = base_surface(bending, region, one.mesh.positions);
      const Positions expected = test::dense_solve(energy, one.mesh.positions, one.roles, none);
      CHECK(test::largest_difference(q, expected) < 1e-9);
      // Values at the handle alone, by the solve of frames.
      ThreadPool pool(1);
      Positions at_handle = Positions::Zero(one.mesh.vertex_count(), 3);
      for (int v : region.handle_vertices) at_handle.row(v) = one.mesh.positions.row(v);
      Rows values = Rows::Zero(Index(region.handle_vertices.size()), 4);
      for (Index i = 0; i < values.rows(); ++i)
        values.row(i).head<3>() = at_handle.row(region.handle_vertices[size_t(i)]);
      std::vector<int> rows(size_t(region.free_count()));
      std::iota(rows.begin(), rows.end(), 0);
      const Rows resting = Rows::Zero(region.free_count(), 4);
      Rows extended = resting;
      HandleSolve solve(bending, region, &pool);
      SparseMatrix at_handles(values.rows(), values.rows());
      at_handles.setIdentity();
      solve.prepare_frames(at_handles, rows, Precision::full);
      solve.add_extended(values, resting, extended);
      const Positions alone = test::dense_solve(energy, at_handle, one.roles, none);
      for (int r = 0; r < region.free_count(); ++r)
        CHECK((extended.row(r).head<3>() - alone.row(region.free[r])).norm() < 1e-9);
      energy = energy * step;
    }
  }
}

TEST_CASE("hubs of thousands of neighbours add few entries and no wide supernodes") {
  const int sides = 2000, rings = 6;
  const Mesh mesh = rings_about_poles(sides, rings, true);
  std::vector<int> roles(static_cast<size_t>(mesh.vertex_count()), kFree);
  for (int j = 0; j < 2 * sides; ++j) roles[1 + 2 * sides + j] = j % sides < sides / 2 ? kFixed : 0;
  const Region region = make_region(mesh, roles, 1);
  const auto operators = surface_operators(mesh.positions, mesh.triangles);
  const SparseMatrix poisson = free_block(operators.laplacian, region);
  const Dissection dissection = free_dissection(poisson, region, mesh.positions);
  const SparseMatrix bending = energy_block(operators, region, Smoothness::thin_plate).sparse;
  for (const SparseMatrix* matrix : {&poisson, &bending}) {
    CHECK(matrix->nonZeros() < 25 * Index(region.free_count()));
    const SymbolicCholesky symbolic(*matrix, dissection.order(*matrix));
    for (int s = 0; s < symbolic.supernode_count(); ++s)
      CHECK(symbolic.width(s) + symbolic.height(s) < 400);
  }
}

TEST_CASE("a wheel of 1,500 spokes follows a rigid motion exactly, its base an affine one") {
  const int sides = 1500;
  const Mesh mesh = rings_about_poles(sides, 1, false);
  std::vector<int> roles(static_cast<size_t>(mesh.vertex_count()), kFree);
  for (int j = 0; j < sides; j += 5) roles[1 + j] = 0;
  std::srand(5);
  const test::Affine motion = test::Affine::Random();
  const test::Affine turn = test::rotation_about(0.7, {1, 2, 3}, {0, 0, 0}, {0.3, 0.2, 0.1});
  UpdateOptions base = test::shown_base();
  base.base_deformer = BaseDeformer::linear;
  for (Smoothness smoothness :
       {Smoothness::membrane, Smoothness::thin_plate, Smoothness::curvature_variation}) {
    INFO("order " << static_cast<int>(smoothness));
    BindOptions options;
    options.smoothness = smoothness;
    Deformer deformer(mesh, roles, 1, options);
    CHECK(test::largest_difference(test::surface(deformer, {motion}, base),
                                   test::transformed(motion, deformer.base())) < 1e-9);
    CHECK(test::largest_difference(test::surface(deformer, {turn}, false),
                                   test::transformed(turn, mesh.positions)) < 1e-9);
  }
}
