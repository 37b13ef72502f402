// SPDX-License-Identifier: GPL-3.0-or-later
#include "surface/basis.h"

#include <Eigen/Dense>

#include "catch.h"
#include "dense_reference.h"
#include "meshes.h"
#include "surface/base_surface.h"
#include "systems/free_block.h"

using namespace dd;

namespace {

struct Bound {
  Mesh mesh = test::rough_sphere(3, 0.1);
  std::vector<int> roles;
  SurfaceOperators operators;
  Region region;
  Bound() {
    roles = test::roles_by_height(mesh, -0.6, 0.75);
    for (Index v = 0; v < mesh.positions.rows(); ++v)
      if (mesh.positions(v, 0) > 0.9) roles[v] = 1;
    operators = surface_operators(mesh.positions, mesh.triangles);
    region = split_region(mesh, roles, 2);
  }
};

/// Rows as in Region::free.
RowOrder plain_order(const Region& region) {
  RowOrder order;
  order.vertex_of_row = region.free;
  order.row_of_vertex = region.row;
  order.free_count = region.free_count();
  return order;
}

}  // namespace

TEST_CASE("the base solves L M⁻¹ L q = 0 and keeps constrained vertices") {
  const Bound b;
  const int n = b.mesh.vertex_count();
  const PolyharmonicSystem bending(b.operators, b.region);
  const Positions q = base_surface(bending, b.region, b.mesh.positions);
  const SparseMatrix& L = b.operators.laplacian;
  const Eigen::VectorXd inverse_masses = b.operators.masses.cwiseInverse();
  const RowMatrix residual = L * RowMatrix(inverse_masses.asDiagonal() * RowMatrix(L * q));
  const RowMatrix size =
      L * RowMatrix(inverse_masses.asDiagonal() * RowMatrix(L * b.mesh.positions));
  for (int v = 0; v < n; ++v) {
    if (b.region.row[v] >= 0)
      CHECK(residual.row(v).norm() < 1e-9 * size.norm());
    else
      CHECK(q.row(v) == b.mesh.positions.row(v));
  }

  const auto dense = test::dense_operators(b.mesh.positions, b.mesh.triangles);
  const Positions expected =
      test::dense_solve(dense.L * dense.M.inverse() * dense.L, b.mesh.positions, b.roles,
                        Eigen::MatrixXd::Zero(n, 3));
  CHECK(test::largest_difference(q, expected) < 1e-9);
}

TEST_CASE("basis functions give the bi-Laplacian's own solution (T-basis = direct solve)") {
  const Bound b;
  const PolyharmonicSystem bending(b.operators, b.region);
  const HandleBasis basis =
      handle_basis(bending, b.region, b.mesh.positions, plain_order(b.region));
  REQUIRE(basis.weights.cols() == 8);

  std::srand(9);
  test::Affine handles[2] = {test::Affine::Random(), test::Affine::Random()};
  RowMatrix delta = RowMatrix::Zero(b.mesh.vertex_count(), 3), coefficients(8, 3);
  for (int h = 0; h < 2; ++h) {
    const Eigen::Matrix3d change = handles[h].leftCols<3>() - Eigen::Matrix3d::Identity();
    coefficients.middleRows<3>(4 * h) = change.transpose();
    coefficients.row(4 * h + 3) =
        (change * basis.centres.row(h).transpose() + handles[h].col(3)).transpose();
  }
  for (int v : b.region.handle_vertices)
    delta.row(v) = test::transformed(handles[b.region.role[v]], b.mesh.positions.row(v)) -
                   b.mesh.positions.row(v);
  const RowMatrix direct = bending.extend(delta);
  CHECK((basis.weights * coefficients - direct).cwiseAbs().maxCoeff() < 1e-9);
}

TEST_CASE("a handle's functions are 1 and its coordinates when everything constrained is in it") {
  Bound b;
  for (int& role : b.roles) role = role == kFree ? kFree : 0;
  b.region = split_region(b.mesh, b.roles, 1);
  const PolyharmonicSystem bending(b.operators, b.region);
  const HandleBasis basis =
      handle_basis(bending, b.region, b.mesh.positions, plain_order(b.region));
  const Positions q = base_surface(bending, b.region, b.mesh.positions);
  for (int r = 0; r < b.region.free_count(); ++r) {
    CHECK(basis.weights(r, 3) == Approx(1).epsilon(1e-9));
    const Eigen::RowVector3d arm = q.row(b.region.free[r]) - basis.centres.row(0);
    CHECK((basis.weights.row(r).head<3>() - arm).norm() < 1e-9);
  }
}

TEST_CASE("each order of smoothness solves its own energy") {
  const Bound b;
  const auto dense = test::dense_operators(b.mesh.positions, b.mesh.triangles);
  const Eigen::MatrixXd step = dense.M.inverse() * dense.L;
  const Eigen::MatrixXd none = Eigen::MatrixXd::Zero(b.mesh.vertex_count(), 3);
  Eigen::MatrixXd energy = dense.L;
  for (Smoothness smoothness :
       {Smoothness::membrane, Smoothness::thin_plate, Smoothness::curvature_variation}) {
    const PolyharmonicSystem bending(b.operators, b.region, smoothness);
    const Positions q = base_surface(bending, b.region, b.mesh.positions);
    const Positions expected = test::dense_solve(energy, b.mesh.positions, b.roles, none);
    CHECK(test::largest_difference(q, expected) < 1e-8);
    energy = energy * step;
  }
}

TEST_CASE("a border's slope and curvature are continued as far as the order says") {
  // Over a flat grid, values of a polynomial in x outside the region: the solution between is the
  // spline of the order, exact for polynomials below twice the order.
  const int side = 41;
  const Mesh flat = test::grid(side, side, [](double, double) { return 0.0; });
  // Free between two strips; at the upper and lower border the natural conditions rule.
  const Region region = split_region(flat, test::strip_roles(side, side, 12, side - 12), 1);
  const auto operators = surface_operators(flat.positions, flat.triangles);
  double last = 1;
  for (Smoothness smoothness :
       {Smoothness::membrane, Smoothness::thin_plate, Smoothness::curvature_variation}) {
    RowMatrix values = flat.positions.col(0).array().pow(4).matrix();
    const RowMatrix free = PolyharmonicSystem(operators, region, smoothness).extend(values);
    double worst = 0;
    for (int r = 0; r < region.free_count(); ++r)
      worst = std::max(worst, std::abs(free(r, 0) - values(region.free[r], 0)));
    CHECK(worst < 0.5 * last);
    last = worst;
  }
}

TEST_CASE("a long strip that is held at one end keeps its digits, or is refused beyond them") {
  const auto extended = [](int length) {
    Mesh ribbon = test::grid(length, 2, [](double, double) { return 0.0; });
    ribbon.positions.col(0) *= length - 1;
    const Region region = split_region(ribbon, test::strip_roles(length, 2, 0, length - 3), 1);
    const auto operators = surface_operators(ribbon.positions, ribbon.triangles);
    return PolyharmonicSystem(operators, region).extend(RowMatrix::Ones(ribbon.vertex_count(), 1));
  };
  // A constant is its own extension.
  CHECK((extended(5000).array() - 1).abs().maxCoeff() < 1e-9);
  // The pivots of its energy fall with the cube of the length, below the rounding of double.
  CHECK_THROWS_AS(extended(40000), UnsolvableSurface);
}
