// SPDX-License-Identifier: GPL-3.0-or-later
#include "reconstruction/coarse/coarse_refinement.h"

#include "cases.h"
#include "catch.h"
#include "deform.h"
#include "mesh/measures.h"
#include "mesh/unit_box.h"
#include "reconstruction/coarse/coarse_surface.h"

using namespace dd;
using test::Affine;
using test::surface;

namespace {

constexpr double kLength = 0.009;  // rotation smoothing, as a fraction of active_size

/// A bound surface, and its base and handles moved by the case's motion; in the unit box.
struct Posed {
  explicit Posed(const test::Case& one)
      : pool(2),
        region(make_region(one.mesh, one.roles, 1)),
        bound(Mesh{UnitBox(one.mesh.positions).into(one.mesh.positions), one.mesh.triangles},
              region, {}, pool, {}),
        deformer(one.mesh, one.roles, 1, {}),
        box(one.mesh.positions) {
    deformer.update(one.motion.data(), test::usual());
    base = in_order(box.into(deformer.deformed_base()), bound.order());
    offsets = Rows::Zero(base.rows(), 4);
    for (int r = bound.order().free_count; r < bound.order().fixed_begin; ++r) {
      const Eigen::Vector3d place = one.mesh.positions.row(bound.order().vertex_of_row[r]);
      offsets.row(r).head<3>() = (one.motion * place.homogeneous() - place).transpose() / box.scale;
    }
    linear.assign(1, one.motion.leftCols<3>());
  }

  Rows solved(const FluxSource& source, Rows from) {
    bound.poisson->solve(
        source.at_rest(), [&](int section, double* rows) { source.add(section, rows); }, from);
    return from;
  }

  /// Refined on the surface itself: the reference.
  Rows whole(int iterations) {
    const auto gradients = make_base_gradients(bound, bound.base);
    gradients->take({base, linear}, true);
    Rows moved = solved(*gradients, offsets);
    const auto refinement = make_refinement(bound, &bound.base, kLength * bound.active_size,
                                            bound.operators.masses, false);
    refinement->set_solidity(nullptr, 0);
    refinement->find(iterations, base, {}, moved);
    return solved(*refinement, moved);
  }

  Rows coarse(int iterations) {
    const auto refinement = CoarseRefinement::make(bound, bound.base, kLength * bound.active_size);
    REQUIRE(refinement);
    refinement->set_solidity(0);
    refinement->find(iterations, {base, linear}, {}, offsets);
    return solved(*refinement, offsets);
  }

  ThreadPool pool;
  Region region;
  BoundSurface bound;
  Deformer deformer;
  UnitBox box;
  Rows base, offsets;
  std::vector<Eigen::Matrix3d> linear;
};

double farthest(const Rows& a, const Rows& b) {
  return (a - b).leftCols<3>().rowwise().norm().maxCoeff();
}

}  // namespace

TEST_CASE("coarse: the result is that of the whole iteration to 0.2% of the box", "[large]") {
  for (const test::Case& one : {test::lifted_plane(201), test::subdivided(test::bent_cylinder()),
                                test::subdivided(test::subdivided(test::twisted_bar())),
                                test::subdivided(test::bent_cactus())}) {
    Posed posed(one);
    const Eigen::RowVector3d size = posed.bound.mesh.positions.colwise().maxCoeff() -
                                    posed.bound.mesh.positions.colwise().minCoeff();
    INFO(one.name << ", " << one.mesh.vertex_count() << " vertices");
    const Rows one_pass = posed.whole(1);
    for (int iterations : {4, 8}) {
      const Rows whole = posed.whole(iterations);
      const double difference = farthest(posed.coarse(iterations), whole);
      CHECK(difference < 2e-3 * size.norm());
      CHECK(difference < 0.1 * farthest(one_pass, whole));
    }
  }
}

TEST_CASE("coarse: linear functions over a flat surface are interpolated exactly") {
  test::Case sheet = test::pulled_disc(200, 0.1);
  Posed posed(sheet);
  const double spacing = 0.02;
  const auto coarse = CoarseSurface::make(posed.bound, spacing);
  REQUIRE(coarse);
  const FactoredSurface& surface = coarse->surface();
  CHECK(surface.mesh.vertex_count() < 0.2 * sheet.mesh.vertex_count());
  const auto stencils = coarse->stencils(posed.bound);
  REQUIRE(int(stencils.size()) == posed.bound.poisson->active_vertex_count());
  double worst = 0;
  for (size_t i = 0; i < stencils.size(); ++i) {
    Eigen::RowVector3d place(0, 0, 0);
    double sum = 0;
    for (int k = 0; k < 3; ++k) {
      const int row = surface.poisson->active_row(stencils[i].active_index[k]);
      CHECK(stencils[i].weight[k] >= 0);
      place += stencils[i].weight[k] * surface.rest.row(row).head<3>();
      sum += stencils[i].weight[k];
    }
    CHECK(sum == Approx(1));
    const int row = posed.bound.poisson->active_row(static_cast<int>(i));
    worst = std::max(worst, (place - posed.bound.rest.row(row).head<3>()).norm());
  }
  CHECK(worst < 1e-9);
}

TEST_CASE("coarse: rest, rigid motion, scale, renumbering and threads are kept") {
  const auto plane = test::lifted_plane(201);
  Deformer deformer(plane.mesh, plane.roles, 1, {});
  const UpdateOptions how = test::usual();
  CHECK(test::largest_difference(surface(deformer, {test::identity()}, how), plane.mesh.positions) <
        1e-10);
  const Affine motion = test::rotation_about(2.8, {1, 2, 0.5}, {0.2, 0, 0}, {0.3, -1, 2});
  Deformer held(plane.mesh, test::held_by_one(plane.roles), 1, {});
  CHECK(test::largest_difference(surface(held, {motion}, how),
                                 test::transformed(motion, plane.mesh.positions)) < 1e-8);

  const Positions expected = surface(deformer, {plane.motion}, how);
  Mesh scaled = plane.mesh;
  scaled.positions *= 1024;
  Affine scaled_motion = plane.motion;
  scaled_motion.col(3) *= 1024;
  Deformer large(scaled, plane.roles, 1, {});
  CHECK(test::largest_difference(surface(large, {scaled_motion}, how) / 1024, expected) < 1e-9);

  const auto renumbered = test::renumbered(plane.mesh, plane.roles);
  Deformer other(renumbered.mesh, renumbered.roles, 1, {});
  const Positions result = surface(other, {plane.motion}, how);
  double worst = 0;
  for (int v = 0; v < plane.mesh.vertex_count(); ++v)
    worst = std::max(worst, (result.row(renumbered.new_of_old[v]) - expected.row(v)).norm());
  // A vertex above the edge of two coarse triangles goes to one of them by their numbers.
  CHECK(worst < 1e-6);

  BindOptions single;
  single.threads = 1;
  Deformer alone(plane.mesh, plane.roles, 1, single);
  CHECK(surface(alone, {plane.motion}, how) == expected);
}

TEST_CASE("coarse: the result depends on the pose alone and has no jumps in a drag", "[large]") {
  const test::Case bar = test::subdivided(test::subdivided(test::bent_cylinder()));
  Deformer deformer(bar.mesh, bar.roles, 1, {});
  // Through 135°, beyond which the unrefined result is blended in.
  const auto motion = [](double way) { return test::bent_cylinder(125 + 20 * way).motion; };
  const Positions last = test::dragged(deformer, 40, motion, test::usual());
  Deformer fresh(bar.mesh, bar.roles, 1, {});
  CHECK(surface(fresh, {test::bent_cylinder(145).motion}, test::usual()) == last);
}

TEST_CASE("coarse: a whole turn is refined without folds, a small mesh has no coarse level") {
  // The handle's matrix is the identity and the base blends motions: the refinement knows of the
  // turn by the gauge alone.
  const test::Case bar = test::subdivided(test::subdivided(test::twisted_bar()));
  Deformer deformer(bar.mesh, bar.roles, 1, {});
  UpdateOptions how = test::usual();
  how.turns = {0, 0, 2 * std::acos(-1.0)};
  const Positions result = surface(deformer, {test::identity()}, how);
  std::vector<char> free;
  for (int role : bar.roles) free.push_back(role == kFree);
  CHECK(measure(bar.mesh, result, free).new_intersecting_pairs == 0);

  Posed few(test::bent_cactus());
  CHECK(!CoarseRefinement::make(few.bound, few.bound.base, kLength * few.bound.active_size));
}
