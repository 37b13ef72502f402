// SPDX-License-Identifier: GPL-3.0-or-later
#include "deform/draft.h"

#include "cases.h"
#include "catch.h"
#include "deform.h"
#include "mesh/unit_box.h"

using namespace dd;
using test::Affine;
using test::Case;

namespace {

std::vector<double> numbers(const std::vector<Affine>& handles) {
  std::vector<double> result;
  for (const Affine& matrix : handles)
    result.insert(result.end(), matrix.data(), matrix.data() + 12);
  return result;
}

std::unique_ptr<Draft> draft_of(const Case& one, int handles = 1, const BindOptions& options = {}) {
  std::unique_ptr<Draft> draft = Draft::make(one.mesh, one.roles, handles, options);
  REQUIRE(draft);
  return draft;
}

Positions surface_of(Draft& draft, const std::vector<Affine>& handles,
                     const UpdateOptions& options = test::usual()) {
  return draft.rest() + draft.update(numbers(handles).data(), options);
}

/// Some 62,000 to 116,000 vertices.
std::vector<Case> dense_cases() {
  return {test::lifted_plane(251), test::subdivided(test::subdivided(test::bent_cylinder())),
          test::subdivided(test::subdivided(test::twisted_bar())),
          test::subdivided(test::subdivided(test::bent_cactus()))};
}

/// The case with a second handle in place of its fixed vertices.
Case twice_held(Case one) {
  for (int& role : one.roles)
    if (role == kFixed) role = 1;
  return one;
}

}  // namespace

TEST_CASE("draft: it is near the result, by each method that a frame can show", "[large]") {
  for (const Case& one : dense_cases()) {
    Deformer deformer(one.mesh, one.roles, 1, {});
    const auto draft = draft_of(one);
    const double box = bounding_box_diagonal(one.mesh.positions);
    CHECK(draft->coarse().mesh().vertex_count() < 0.3 * one.mesh.vertex_count());
    for (const auto& options : {test::usual(), test::usual(8), test::by(MethodKind::detail),
                                test::by(MethodKind::variational), test::by(MethodKind::gradient),
                                test::by(MethodKind::normal), test::shown_base()}) {
      const Eigen::VectorXd error = (surface_of(*draft, {one.motion}, options) -
                                     test::surface(deformer, {one.motion}, options))
                                        .rowwise()
                                        .norm();
      INFO(one.name << " method " << int(options.method) << " mean " << error.mean() / box
                    << " largest " << error.maxCoeff() / box);
      const bool default_way =
          options.output == Output::result && options.of_method.refined.iterations == 4;
      CHECK(error.mean() < (default_way ? 0.001 : 0.003) * box);
      CHECK(error.maxCoeff() < (default_way ? 0.01 : 0.025) * box);
    }
  }
}

TEST_CASE("draft: at rest nothing moves, handles are met and fixed vertices stay") {
  const Case one = test::subdivided(test::subdivided(test::bent_cactus()));
  const auto draft = draft_of(one);
  CHECK(draft->update(numbers({test::identity()}).data(), test::usual()).cwiseAbs().maxCoeff() <
        1e-12);
  const Positions there = surface_of(*draft, {one.motion});
  const Positions moved = test::transformed(one.motion, one.mesh.positions);
  for (size_t v = 0; v < one.roles.size(); ++v) {
    const auto row = Index(v);
    if (one.roles[v] == kFixed) CHECK(there.row(row) == one.mesh.positions.row(row));
    if (one.roles[v] == 0) CHECK((there.row(row) - moved.row(row)).norm() < 1e-12);
  }
}

TEST_CASE("draft: a rigid motion of all handles moves the result rigidly") {
  Case one = twice_held(test::subdivided(test::subdivided(test::bent_cactus())));
  const auto draft = draft_of(one, 2);
  const Affine all = test::rotation_about(2.2, {1, 2, 3}, {0.1, 0, 0.5}, {3, -2, 1});
  CHECK(test::largest_difference(surface_of(*draft, {all, all}),
                                 test::transformed(all, one.mesh.positions)) < 1e-6);
  // So does one after another motion of one handle alone.
  Affine turned = all;
  turned.leftCols<3>() = all.leftCols<3>() * one.motion.leftCols<3>();
  turned.col(3) = all.leftCols<3>() * one.motion.col(3) + all.col(3);
  const Positions bent = surface_of(*draft, {one.motion, test::identity()});
  CHECK(test::largest_difference(surface_of(*draft, {turned, all}), test::transformed(all, bent)) <
        1e-5);
}

TEST_CASE("draft: units and the number of threads don't matter") {
  Case one = test::subdivided(test::subdivided(test::twisted_bar()));
  const auto draft = draft_of(one);
  const Positions there = surface_of(*draft, {one.motion});
  BindOptions alone;
  alone.threads = 1;
  CHECK(surface_of(*draft_of(one, 1, alone), {one.motion}) == there);
  // The contraction chooses among vertices at the same distance by rounding: hence 1e-3.
  const double unit = 3000;
  one.mesh.positions *= unit;
  one.motion.col(3) *= unit;
  CHECK(test::largest_difference(surface_of(*draft_of(one), {one.motion}) / unit, there) < 1e-3);
}

TEST_CASE("draft: free handles turn as on the surface") {
  const Case one = twice_held(test::subdivided(test::subdivided(test::bent_cylinder())));
  const auto draft = draft_of(one, 2);
  Deformer deformer(one.mesh, one.roles, 2, {});
  Affine aside = test::identity();
  aside(0, 3) = 0.5;
  UpdateOptions options = test::usual();
  options.free = {1, 0};
  const Positions there = surface_of(*draft, {aside, test::identity()}, options);
  const Positions exact = test::surface(deformer, {aside, test::identity()}, options);
  const double box = bounding_box_diagonal(one.mesh.positions);
  CHECK(test::largest_difference(there, exact) < 0.02 * box);
  options.free = {0, 0};
  CHECK(test::largest_difference(surface_of(*draft, {aside, test::identity()}, options), there) >
        0.02 * box);
}

TEST_CASE("draft: parts without a handle rest, parts wholly in a handle follow it") {
  const Case one = test::subdivided(test::subdivided(test::bent_cylinder()));
  Case all = one;
  const Mesh apart{one.mesh.positions.rowwise() + Eigen::RowVector3d(1, 0, 0), one.mesh.triangles};
  const Mesh far{one.mesh.positions.rowwise() + Eigen::RowVector3d(2, 0, 0), one.mesh.triangles};
  all.mesh = test::appended(test::appended(one.mesh, apart), far);
  const size_t n = one.roles.size();
  all.roles.insert(all.roles.end(), n, kFree);
  all.roles.insert(all.roles.end(), n, 1);
  const auto draft = draft_of(all, 2);
  const Affine aside = test::rotation_about(1, {0, 0, 1}, {2, 0, 0}, {0, 5, 0});
  const Positions there = surface_of(*draft, {one.motion, aside});
  const auto part = [&](const Positions& p, int k) {
    return Positions(p.middleRows(Index(n) * k, Index(n)));
  };
  CHECK(test::largest_difference(part(there, 0), surface_of(*draft_of(one), {one.motion})) < 2e-3);
  CHECK(part(there, 1) == apart.positions);
  CHECK(test::largest_difference(part(there, 2), test::transformed(aside, far.positions)) < 1e-12);
}

TEST_CASE("draft: it is near the result for energies of each order", "[large]") {
  const Case one = test::subdivided(test::subdivided(test::bent_cylinder(60)));
  const double box = bounding_box_diagonal(one.mesh.positions);
  for (const Smoothness order : {Smoothness::membrane, Smoothness::curvature_variation}) {
    BindOptions options;
    options.smoothness = order;
    Deformer deformer(one.mesh, one.roles, 1, options);
    const Eigen::VectorXd error = (surface_of(*draft_of(one, 1, options), {one.motion}) -
                                   test::surface(deformer, {one.motion}, test::usual()))
                                      .rowwise()
                                      .norm();
    INFO(int(order) << " mean " << error.mean() / box << " largest " << error.maxCoeff() / box);
    CHECK(error.mean() < 0.002 * box);
    CHECK(error.maxCoeff() < 0.01 * box);
  }
}

TEST_CASE("draft: triangles without area don't prevent one") {
  const Case whole = test::subdivided(test::subdivided(test::bent_cylinder()));
  Case one = whole;
  // A vertex and all its neighbours on one line.
  const int at = 60 * 160 + 77;
  REQUIRE(one.roles[size_t(at)] == kFree);
  for (Index j = 0; j < one.mesh.triangles.rows(); ++j) {
    const auto corners = one.mesh.triangles.row(j);
    if ((corners.array() != at).all()) continue;
    for (int v : corners)
      one.mesh.positions.row(v).head<2>() = one.mesh.positions.row(at).head<2>();
  }
  const Positions moved = surface_of(*draft_of(one), {one.motion}) - one.mesh.positions;
  // All but the fan of this one vertex moves as without the damage, and the fan nearly so.
  const Positions undamaged = surface_of(*draft_of(whole), {whole.motion}) - whole.mesh.positions;
  const Eigen::VectorXd change = (moved - undamaged).rowwise().norm();
  const double box = bounding_box_diagonal(whole.mesh.positions);
  CHECK(change.mean() < 1e-6 * box);
  CHECK(change.maxCoeff() < 5e-3 * box);
}

TEST_CASE("draft: small meshes and bases from outside have none, wrong calls are refused") {
  const Case one = test::bent_cylinder();
  CHECK(!Draft::make(one.mesh, one.roles, 1, {}));
  const Case dense = test::subdivided(test::subdivided(one));
  BindOptions options;
  options.base = dense.mesh.positions;
  CHECK(!Draft::make(dense.mesh, dense.roles, 1, options));
  CHECK_THROWS_AS(Draft::make(dense.mesh, dense.roles, 2, {}), Error);
  CHECK_THROWS_AS(surface_of(*draft_of(dense), {one.motion}, test::by(MethodKind::examples)),
                  Error);
}
