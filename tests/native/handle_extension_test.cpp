// SPDX-License-Identifier: GPL-3.0-or-later
#include "base/handle_extension.h"

#include <Eigen/Dense>

#include "base/base_surface.h"
#include "catch.h"
#include "deform.h"
#include "dense_reference.h"
#include "meshes.h"
#include "reconstruction/harmonic_blend.h"
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
    region = make_region(mesh, roles, 2);
  }
};

/// The row order of Region::free.
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

TEST_CASE("handles' displacements extend as by K itself, from kept functions or by a solve") {
  const Bound b;
  ThreadPool pool(2);
  const HandleCoordinates coordinates(b.region, b.mesh.positions);
  REQUIRE(coordinates.count() == 8);
  std::srand(9);
  const test::Affine handles[2] = {test::Affine::Random(), test::Affine::Random()};
  RowMatrix delta = RowMatrix::Zero(b.mesh.vertex_count(), 3);
  RowMatrix coefficients = RowMatrix::Zero(8, 4);
  for (int h = 0; h < 2; ++h) {
    const Eigen::Matrix3d change = handles[h].leftCols<3>() - Eigen::Matrix3d::Identity();
    const Eigen::Vector3d centre = coordinates.centres().row(h);
    coefficients.block<3, 3>(4 * h, 0) = change.transpose();
    coefficients.block<1, 3>(4 * h + 3, 0) = (change * centre + handles[h].col(3)).transpose();
  }
  for (int v : b.region.handle_vertices)
    delta.row(v) = test::transformed(handles[b.region.role[v]], b.mesh.positions.row(v)) -
                   b.mesh.positions.row(v);
  const RowOrder order = plain_order(b.region);
  for (Smoothness smoothness :
       {Smoothness::membrane, Smoothness::thin_plate, Smoothness::curvature_variation}) {
    const PolyharmonicSystem bending(b.operators, b.region, smoothness);
    const RowMatrix direct = bending.extend(delta);
    for (const auto& [kept, single_solve] : {std::pair(KeptOfEnergy::basis_functions, false),
                                             {KeptOfEnergy::basis_functions, true},
                                             {KeptOfEnergy::factor, true}}) {
      INFO("order " << static_cast<int>(smoothness) << ", kept " << static_cast<int>(kept));
      HandleExtensionOptions options;
      options.pool = &pool;
      options.single_solve = single_solve;
      options.kept = kept;
      const HandleExtension extension(bending, coordinates, b.region, b.mesh.positions, order,
                                      options);
      REQUIRE(extension.factor_kept() == (kept == KeptOfEnergy::factor));
      Rows moved = Rows::Constant(b.region.free_count(), 4, 0.5);
      for (int k = 0; k < 2; ++k) extension.displace(coefficients, moved, moved);
      CHECK((moved.leftCols<3>() - 2 * direct).cwiseAbs().maxCoeff() == Approx(0.5).margin(1e-8));
      CHECK((moved.leftCols<3>() - 2 * direct).cwiseAbs().minCoeff() == Approx(0.5).margin(1e-8));
      RowMatrix space;
      CHECK((extension.basis_functions(space) * coefficients.leftCols<3>() - direct)
                .cwiseAbs()
                .maxCoeff() < 1e-8);
    }
  }
}

namespace {

/// A strip with four handles across it and nothing fixed.
struct Strip {
  explicit Strip(int length) {
    mesh = test::grid(length, 5,
                      [](double x, double y) { return 0.1 * std::sin(9 * x) + 0.2 * x * y; });
    roles.assign(static_cast<size_t>(mesh.vertex_count()), kFree);
    for (int h = 0; h < 4; ++h)
      for (int v = 0; v < 10; ++v) roles[size_t(40 * h + v)] = h;
  }
  /// Adds a plate with two handles beside the strip, `size` times as large.
  void add_plate(double size) {
    Mesh plate = test::grid(20, 20, [](double x, double y) { return 0.1 * x * y; });
    plate.positions *= size;
    mesh.positions.rowwise() += Eigen::RowVector3d(0.5 * size, 0.4 * size, 0.03 * size);
    mesh = test::appended(mesh, plate);
    roles.resize(size_t(mesh.vertex_count()), kFree);
    for (int v = 0; v < 20; ++v) {
      roles[roles.size() - 400 + size_t(v)] = 4;
      roles[roles.size() - 1 - size_t(v)] = 5;
    }
  }
  Mesh mesh;
  std::vector<int> roles;
};

}  // namespace

/// The coordinates' values at the handles' vertices, n×count.
static RowMatrix given_values(const HandleCoordinates& coordinates, const Region& region,
                              const Mesh& mesh) {
  RowMatrix values = RowMatrix::Zero(mesh.vertex_count(), coordinates.count());
  for (int v : region.handle_vertices) {
    const int h = region.role[size_t(v)];
    values.row(v).segment(coordinates.begin(h), coordinates.count(h)) =
        coordinates.at(mesh.positions.row(v), h).head(coordinates.count(h));
  }
  return values;
}

/// The functions of a bound surface, rows as in Region::free.
static RowMatrix functions_of(const BoundSurface& bound) {
  RowMatrix space;
  const RowMatrix& in_order = bound.extension.basis_functions(space);
  RowMatrix functions(in_order.rows(), in_order.cols());
  for (int r = 0; r < bound.region.free_count(); ++r)
    functions.row(r) =
        in_order.row(bound.order().row_of_vertex[size_t(bound.region.free[size_t(r)])]);
  return functions;
}

TEST_CASE(
    "functions of many coordinates are K's own, whether one solve is exact enough for them or "
    "not") {
  // Strips for which one solve is exact enough in double precision, only in single, and in neither;
  // beside a large plate the same error is smaller relative to the box. least, most: its bounds.
  const auto [length, plate, least, most] = GENERATE(table<int, double, double, double>(
      {{40, 0, 0, 1e-10}, {300, 10, 1e-10, 5e-7}, {1200, 0, 5e-7, 1}, {1200, 100, 1e-9, 1}}));
  Strip strip(length);
  if (plate > 0) strip.add_plate(plate);
  const Mesh mesh = {strip.mesh.positions / bounding_box_diagonal(strip.mesh.positions),
                     strip.mesh.triangles};
  const Region region = make_region(mesh, strip.roles, plate > 0 ? 6 : 4);
  const HandleCoordinates coordinates(region, mesh.positions);
  const Index count = coordinates.count();
  REQUIRE(count >= 16);
  ThreadPool pool(2);
  const RowMatrix values = given_values(coordinates, region, mesh);
  const SurfaceOperators operators = surface_operators(mesh.positions, mesh.triangles);
  const PolyharmonicSystem bending(operators, region);
  const RowMatrix refined = bending.extend(values);
  const double size = refined.cwiseAbs().maxCoeff();
  const auto off = [&](const RowMatrix& functions) {
    return (functions - refined).cwiseAbs().maxCoeff() / size;
  };
  for (const Precision precision : {Precision::full, Precision::single}) {
    BindOptions options;
    options.precision = precision;
    options.triangulation = Triangulation::given;
    const BoundSurface bound(mesh, region, options, pool, {});
    // The bind's limits, 1e-8 and 5e-7, apply to an estimate from one column: hence the factor 5.
    CHECK(off(functions_of(bound)) < 5 * (precision == Precision::full ? 1e-8 : 5e-7));
  }
  // The error of one solve is that of the case.
  const RowMatrix at_handles = values(region.handle_vertices, kAllIndices);
  const HandleSolve solve(bending, region, &pool);
  HandleSolve::Scratch space;
  RowMatrix once(region.free_count(), count);
  Rows four(at_handles.rows(), 4);
  for (FourColumns some(at_handles); some.next();) {
    for (Index i = 0; i < four.rows(); ++i) four.row(i) = some(i);
    once.middleCols(some.first(), some.width()) = solve.extend(four, space).leftCols(some.width());
  }
  const double by_one_solve = off(once);
  CHECK(by_one_solve > least);
  CHECK(by_one_solve < most);
}

TEST_CASE(
    "a few functions take one solve for frames in single precision, and are refined for double") {
  for (const int length : {40, 300, 1200}) {
    INFO(length);
    Strip strip(length);
    for (int& role : strip.roles)
      if (role >= 2) role = kFixed;
    const Mesh mesh = {strip.mesh.positions / bounding_box_diagonal(strip.mesh.positions),
                       strip.mesh.triangles};
    const Region region = make_region(mesh, strip.roles, 2);
    const HandleCoordinates coordinates(region, mesh.positions);
    REQUIRE(coordinates.count() <= 12);
    ThreadPool pool(2);
    const SurfaceOperators operators = surface_operators(mesh.positions, mesh.triangles);
    const RowMatrix refined =
        PolyharmonicSystem(operators, region).extend(given_values(coordinates, region, mesh));
    for (const Precision precision : {Precision::full, Precision::single}) {
      BindOptions options;
      options.precision = precision;
      options.triangulation = Triangulation::given;
      const BoundSurface bound(mesh, region, options, pool, {});
      CHECK((functions_of(bound) - refined).cwiseAbs().maxCoeff() <
            (precision == Precision::full ? 1e-10 : 5 * 5e-7) * refined.cwiseAbs().maxCoeff());
    }
  }
}

TEST_CASE("a flat handle, one in a line and one of one point take fewer functions") {
  const Mesh plane = test::grid(13, 13, [](double x, double y) { return 0.1 * x * y; });
  // Handles of a bent patch, of three vertices, of two and of one.
  std::vector<int> roles(169, kFree);
  for (int v : {0, 1, 2, 13, 14, 15}) roles[v] = 0;
  for (int v : {10, 12, 25}) roles[v] = 1;
  for (int v : {90, 92}) roles[v] = 2;
  roles[160] = 3;
  const Region region = make_region(plane, roles, 4);
  const HandleCoordinates coordinates(region, plane.positions);
  const int expected[4] = {4, 3, 2, 1};
  for (int h = 0; h < 4; ++h) CHECK(coordinates.count(h) == expected[h]);

  std::srand(3);
  const RowMatrix C = RowMatrix::Random(16, 4);
  const RowMatrix reduced = coordinates.reduced(C);
  for (int v : region.handle_vertices) {
    const int h = roles[size_t(v)];
    Eigen::RowVector4d all;
    all << plane.positions.row(v) - coordinates.centres().row(h), 1;
    const auto own = coordinates.at(plane.positions.row(v), h);
    CHECK((own * coordinates.reduction(h) - all).norm() < 1e-15);
    CHECK((own * reduced.middleRows(coordinates.begin(h), coordinates.count(h)) -
           all * C.middleRows<4>(4 * h))
              .norm() < 1e-14);
  }
}

TEST_CASE("with everything constrained in one handle its functions are 1 and B's coordinates") {
  Bound b;
  for (int& role : b.roles) role = role == kFree ? kFree : 0;
  b.region = make_region(b.mesh, b.roles, 1);
  ThreadPool pool(1);
  const PolyharmonicSystem bending(b.operators, b.region);
  const HandleCoordinates coordinates(b.region, b.mesh.positions);
  const Positions q = base_surface(bending, b.region, b.mesh.positions);
  for (KeptOfEnergy kept : {KeptOfEnergy::basis_functions, KeptOfEnergy::factor}) {
    HandleExtensionOptions options;
    options.pool = &pool;
    options.single_solve = true;
    options.kept = kept;
    const HandleExtension extension(bending, coordinates, b.region, b.mesh.positions,
                                    plain_order(b.region), options);
    RowMatrix space;
    const RowMatrix& functions = extension.basis_functions(space);
    for (int r = 0; r < b.region.free_count(); ++r) {
      CHECK(functions(r, 3) == Approx(1).epsilon(1e-9));
      const Eigen::RowVector3d arm = q.row(b.region.free[r]) - coordinates.centres().row(0);
      CHECK((functions.row(r).head<3>() - arm).norm() < 1e-9);
    }
  }
}

namespace {

/// Every step-th vertex is a handle of its own.
struct ManyHandles {
  explicit ManyHandles(int levels, int step = 5) : mesh(test::rough_sphere(levels, 0.15)) {
    roles.assign(size_t(mesh.vertex_count()), kFree);
    std::srand(4);
    for (int v = 0; v < mesh.vertex_count(); v += step) {
      if (mesh.positions(v, 2) < -0.6) {
        roles[size_t(v)] = kFixed;
        continue;
      }
      roles[size_t(v)] = count();
      motions.push_back(test::identity() + 0.2 * test::Affine::Random());
    }
  }
  int count() const { return static_cast<int>(motions.size()); }

  Mesh mesh;
  std::vector<int> roles;
  std::vector<test::Affine> motions;
};

}  // namespace

TEST_CASE("with a handle for every fifth vertex a frame solves for its base") {
  const ManyHandles many(3);
  const int count = many.count();
  const Region region = make_region(many.mesh, many.roles, count);
  ThreadPool pool(2);
  // VARIATIONAL uses K on S itself with either metric.
  const Positions displaced =
      test::dense_transfer(many.mesh, many.roles, many.motions, false, true).variational;
  for (BaseMetric metric : {BaseMetric::surface, BaseMetric::base}) {
    const BoundSurface bound(many.mesh, region, test::as_given(metric), pool, {});
    REQUIRE(bound.extension.factor_kept());
    Deformer deformer(many.mesh, many.roles, count, test::as_given(metric));
    for (bool rotation_only : {true, false}) {
      const auto dense = test::dense_transfer(many.mesh, many.roles, many.motions,
                                              metric == BaseMetric::base, rotation_only);
      const Positions result = test::surface(deformer, many.motions, rotation_only);
      CHECK(test::largest_difference(result, dense.surface) < 1e-8);
      CHECK(test::largest_difference(deformer.deformed_base(), dense.base_deformed) < 1e-8);
    }
    const UpdateOptions variational = test::by(MethodKind::variational);
    CHECK(test::largest_difference(test::surface(deformer, many.motions, variational), displaced) <
          1e-8);
  }
}

TEST_CASE("many handles: K's factor is in single precision where that is exact enough") {
  struct {
    Mesh mesh;
    std::vector<int> roles;
    int handles;
    bool enough;
  } cases[2];
  const ManyHandles sphere(5, 50);
  cases[0] = {sphere.mesh, sphere.roles, sphere.count(), true};
  // On a strip of 2,500 rows single precision errs by a thousandth between handles.
  cases[1] = {Strip(2500).mesh, std::vector<int>(5 * 2500, kFree), 0, false};
  for (size_t v = 0; v < cases[1].roles.size(); v += 401) cases[1].roles[v] = cases[1].handles++;
  ThreadPool pool(2);
  std::srand(6);
  for (const auto& one : cases) {
    INFO(one.handles << " handles");
    const Mesh mesh = {one.mesh.positions / bounding_box_diagonal(one.mesh.positions),
                       one.mesh.triangles};
    const Region region = make_region(mesh, one.roles, one.handles);
    const HandleCoordinates coordinates(region, mesh.positions);
    const SurfaceOperators operators = surface_operators(mesh.positions, mesh.triangles);
    const PolyharmonicSystem bending(operators, region);
    const RowMatrix C = RowMatrix::Random(4 * one.handles, 4);
    RowMatrix values = RowMatrix::Zero(mesh.vertex_count(), 3);
    for (int v : region.handle_vertices)  // single vertices, at their centres
      values.row(v) = C.row(4 * one.roles[size_t(v)] + 3).head<3>();
    const RowMatrix expected = bending.extend(values);
    const auto error = [&](Precision precision) {
      HandleExtensionOptions options;
      options.pool = &pool;
      options.single_solve = true;
      options.precision = precision;
      options.kept = KeptOfEnergy::factor;
      const HandleExtension extension(bending, coordinates, region, mesh.positions,
                                      plain_order(region), options);
      REQUIRE(extension.has_precomputed_forward());
      CHECK(extension.in_single() == (precision == Precision::single && one.enough));
      Rows found = Rows::Zero(region.free_count(), 4);
      extension.displace(C, found, found);
      return (found.leftCols<3>() - expected).cwiseAbs().maxCoeff() /
             expected.cwiseAbs().maxCoeff();
    };
    const double full = error(Precision::full), single = error(Precision::single);
    CHECK(full < 1e-6);
    if (one.enough) {
      CHECK(single < 2e-6);
      CHECK(single > 10 * full);
    } else {
      CHECK(single == full);
    }
  }
}

TEST_CASE("many handles: the number of threads changes nothing", "[threads]") {
  // A frame does all of the solve for its base, or half of it because the bind did the other.
  const int step = GENERATE(5, 50);
  const ManyHandles many(5, step);
  {
    ThreadPool pool(2);
    const Region region = make_region(many.mesh, many.roles, many.count());
    BindOptions options;
    options.precision = Precision::single;
    const BoundSurface bound(many.mesh, region, options, pool, {});
    REQUIRE(bound.extension.factor_kept());
    REQUIRE(bound.extension.has_precomputed_forward() == (step == 50));
    REQUIRE(bound.extension.in_single() == (step == 50));
    REQUIRE(bound.poisson->active().sections() > 2);
  }
  BindOptions bind;
  bind.precision = Precision::single;
  bind.threads = 1;
  Deformer alone(many.mesh, many.roles, many.count(), bind);
  bind.threads = 4;
  Deformer shared(many.mesh, many.roles, many.count(), bind);
  UpdateOptions options = test::usual();
  for (BaseDeformer base : {BaseDeformer::linear, BaseDeformer::motions}) {
    options.base_deformer = base;
    CHECK(test::surface(alone, many.motions, options) ==
          test::surface(shared, many.motions, options));
  }
  options.free.assign(size_t(many.count()), 1);
  CHECK(test::surface(alone, many.motions, options) ==
        test::surface(shared, many.motions, options));
}

TEST_CASE("a harmonic blend of many handles' values equals their harmonic weights' sum") {
  Mesh mesh = test::rough_sphere(3, 0.15);
  std::vector<int> roles(size_t(mesh.vertex_count()), kFree);
  int count = 0;
  for (int v = 0; v < mesh.vertex_count(); v += 4)
    roles[size_t(v)] = mesh.positions(v, 2) < -0.6 ? kFixed : count++;
  const Region region = make_region(mesh, roles, count);
  ThreadPool pool(1);
  const BoundSurface bound(mesh, region, {}, pool, {});
  const int free_count = bound.order().free_count;
  REQUIRE(Index(count) * free_count > bound.poisson->entries());
  HarmonicBlend blend(bound);
  std::srand(5);
  const RowMatrix values = RowMatrix::Random(count, 7);
  blend.set_values(values);
  const RowMatrix expected = harmonic_weights(bound, extension_over(bound)) * values;
  CHECK((blend.rows(0, free_count) - expected).cwiseAbs().maxCoeff() < 1e-12);
  CHECK((blend.rows(10, 20) - expected.middleRows(10, 10)).cwiseAbs().maxCoeff() < 1e-12);
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

TEST_CASE("higher orders of smoothness continue a border's slope and curvature") {
  // Over a flat grid, values of a polynomial in x outside the region: the solution between is the
  // spline of the order, exact for polynomials below twice the order.
  const int side = 41;
  const Mesh flat = test::grid(side, side, [](double, double) { return 0.0; });
  // Free between two strips; natural boundary conditions at the upper and lower border.
  const Region region = make_region(flat, test::strip_roles(side, side, 12, side - 12), 1);
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

TEST_CASE("a long strip held at one end is solved exactly, or refused where double can't") {
  const auto extended = [](int length) {
    Mesh ribbon = test::grid(length, 2, [](double, double) { return 0.0; });
    ribbon.positions.col(0) *= length - 1;
    const Region region = make_region(ribbon, test::strip_roles(length, 2, 0, length - 3), 1);
    const auto operators = surface_operators(ribbon.positions, ribbon.triangles);
    return PolyharmonicSystem(operators, region).extend(RowMatrix::Ones(ribbon.vertex_count(), 1));
  };
  // A constant is its own extension.
  CHECK((extended(5000).array() - 1).abs().maxCoeff() < 1e-9);
  // The pivots of its energy fall with the cube of the length, below the rounding of double.
  CHECK_THROWS_AS(extended(40000), UnsolvableSurface);
}
