// SPDX-License-Identifier: GPL-3.0-or-later
#include "match/alignment.h"

#include <cmath>
#include <limits>
#include <utility>

#include "catch.h"
#include "creatures.h"
#include "match/registration.h"
#include "match/triangle_match.h"
#include "mesh/aabb_tree.h"

using namespace dd;

namespace {

/// Exact comparison: an alignment doesn't depend on the number of threads.
void check_same(const Alignment& a, const Alignment& b) {
  CHECK(a.placement.rotation == b.placement.rotation);
  CHECK(a.placement.scale == b.placement.scale);
  CHECK(a.placement.shift == b.placement.shift);
  CHECK(a.map_target == b.map_target);
  CHECK(a.lies_on == b.lies_on);
  CHECK(a.ambiguous == b.ambiguous);
}

/// Mean distance of points from a mesh's triangles.
double mean_distance(const Positions& points, const Mesh& mesh) {
  double sum = 0;
  for (Index v = 0; v < points.rows(); ++v) {
    const Eigen::Vector3d x = points.row(v);
    double least = std::numeric_limits<double>::infinity();
    for (int j = 0; j < mesh.triangle_count(); ++j) {
      const PointOnTriangle nearest = nearest_on_triangle(mesh, j, x);
      Eigen::Vector3d place = Eigen::Vector3d::Zero();
      for (int k = 0; k < 3; ++k)
        place += nearest.barycentric[k] * mesh.positions.row(mesh.triangles(j, k)).transpose();
      least = std::min(least, (x - place).norm());
    }
    sum += least;
  }
  return sum / double(points.rows());
}

}  // namespace

TEST_CASE("a copy that was moved, turned, scaled and renumbered is found without markers",
          "[large]") {
  const Mesh source = test::beast(4);
  for (double angle : {0.0, 0.3, 1.7, 3.0}) {
    const test::Renumbered other =
        test::renumbered({40 * test::turned(source.positions, angle), source.triangles},
                         std::vector<int>(size_t(source.vertex_count()), 0));
    const Positions truth = 40 * test::turned(source.positions, angle);
    const Alignment found = align(source, other.mesh, {});
    CHECK_FALSE(found.ambiguous);
    CHECK(found.placement.scale == Approx(40).epsilon(1e-3));
    CHECK(test::largest_error(register_onto(source, other.mesh, {}, found, {}), truth) < 1e-3);
  }
}

TEST_CASE("a mesh of other triangles on the same surface is found without markers", "[large]") {
  const Mesh source = test::beast(4);
  for (int levels : {3, 5}) {
    const Mesh target = {test::turned(test::beast(levels).positions, 2),
                         test::beast(levels).triangles};
    const Positions fitted = register_onto(source, target, {}, {});
    CHECK(test::mean_error(fitted, test::turned(source.positions, 2)) <
          (levels == 3 ? 0.01 : 2e-3));
    const Match match = match_triangles({fitted, source.triangles}, target, 0.1);
    for (int j = 0; j < target.triangle_count(); ++j) CHECK(match.correspondence.has_source(j));
  }
}

TEST_CASE("two legs, one of which stands where the other stood, are told apart", "[large]") {
  const Mesh source = test::forked(5);
  const Positions truth = test::aside(source.positions);
  const Mesh target = {test::aside(test::forked(4).positions), test::forked(4).triangles};
  const auto is_of_leg = [&](Index v) { return source.positions(v, 2) < -1.2; };
  const Positions by_functions = register_onto(source, target, {}, {});
  CHECK(test::mean_error(by_functions, truth) < 0.015);
  CHECK(test::mean_error(by_functions, truth, is_of_leg) < 0.03);
  // Registration by nearest points alone takes one leg for the other.
  Alignment placed = align(source, target, {});
  REQUIRE(placed.lies_on);
  placed.map_target.clear();
  placed.lies_on = false;
  CHECK(test::mean_error(register_onto(source, target, {}, placed, {}), truth, is_of_leg) > 0.1);
}

TEST_CASE("a body is registered onto a fatter one without markers", "[large]") {
  const Mesh source = test::beast(4), target = test::beast(5);
  const auto fatter = [](Positions p) {
    for (Index v = 0; v < p.rows(); ++v) p.row(v) *= 1 + 0.15 * std::sin(2 * p(v, 0) + p(v, 1));
    p.col(1) *= 1.2;
    return p;
  };
  const Mesh other = {fatter(target.positions), target.triangles};
  CHECK(test::mean_error(register_onto(source, other, {}, {}), fatter(source.positions)) < 0.02);
}

TEST_CASE("the result depends neither on units nor on numbering nor on where the source lies",
          "[large]") {
  const Mesh source = test::beast(3),
             target = {test::raised(test::beast(4).positions, 0.5), test::beast(4).triangles};
  const double box = bounding_box_diagonal(target.positions);
  const Positions fitted = register_onto(source, target, {}, {});
  CHECK(register_onto(source, target, {}, {}) == fitted);
  const Mesh far = {1e3 * source.positions, source.triangles};
  const Mesh small = {1e-3 * target.positions, target.triangles};
  CHECK(test::largest_difference(1e3 * register_onto(far, small, {}, {}), fitted) < 1e-4 * box);
  const test::Renumbered other =
      test::renumbered(source, std::vector<int>(size_t(source.vertex_count()), 0));
  const Positions again = register_onto(other.mesh, target, {}, {});
  double mean = 0;
  for (Index v = 0; v < fitted.rows(); ++v)
    mean += (again.row(other.new_of_old[size_t(v)]) - fitted.row(v)).norm() / double(fitted.rows());
  CHECK(mean < 2e-3 * box);
}

TEST_CASE("a shape that fits as well turned is ambiguous, stands as it was, or goes by a marker",
          "[large]") {
  // A pillar with a square base fits as well after a quarter turn about z.
  Mesh pillar = test::sphere(4);
  for (Index v = 0; v < pillar.positions.rows(); ++v) {
    auto p = pillar.positions.row(v);
    p /= std::pow(std::pow(p[0], 6) + std::pow(p[1], 6) + std::pow(p[2], 6), 1.0 / 6);
    p[2] *= 2.5 + 0.8 * p[2];
  }
  const Alignment found = align(pillar, pillar, {});
  CHECK(found.ambiguous);
  CHECK(found.placement.rotation.isIdentity(1e-3));
  const Positions quarter = test::transformed(
      test::rotation_about(std::acos(0.0), {0, 0, 1}, {0, 0, 0}, {0, 0, 0}), pillar.positions);
  Index side = 0, other = 0;
  pillar.positions.col(0).maxCoeff(&side);
  (pillar.positions.rowwise() - quarter.row(side)).rowwise().norm().minCoeff(&other);
  const Alignment marked = align(pillar, pillar, {{int(side), int(other)}});
  CHECK_FALSE(marked.ambiguous);
  const Positions there =
      marked.placement.scale * pillar.positions * marked.placement.rotation.transpose();
  CHECK((there.row(side) - pillar.positions.row(other)).norm() < 0.1);
  CHECK_FALSE(align(test::beast(4), test::beast(3), {}).ambiguous);
}

TEST_CASE("small sheets are registered: points that face nothing don't improve a fit") {
  const auto height = [](double x, double y) {
    return 0.3 * x * x + 0.2 * y * y * y - 0.2 * x * y;
  };
  for (const int side : {3, 5, 9, 20}) {
    const Mesh source = test::grid(side, side + 2, height);
    const Mesh flat = test::grid(side + 1, side + 3, height);
    for (const double angle : {0.0, 2.0}) {
      const Mesh target = {test::turned(flat.positions, angle), flat.triangles};
      const Positions fitted = register_onto(source, target, {}, {});
      CHECK(test::mean_error(fitted, test::turned(source.positions, angle)) < 0.02);
      const Match match = match_triangles({fitted, source.triangles}, target, 0.1);
      for (int j = 0; j < target.triangle_count(); ++j) CHECK(match.correspondence.has_source(j));
    }
  }
}

TEST_CASE("the number of threads changes nothing of a match without markers", "[threads][large]") {
  const Mesh posed = test::forked(3), whole = test::hollow(3);
  const bool lacking = GENERATE(false, true);
  const Mesh source = lacking ? whole : posed;
  const Mesh target =
      lacking ? test::beast(4) : Mesh{test::aside(posed.positions), posed.triangles};
  const auto found = [&](int threads) { return align(source, target, {}, threads); };
  const auto fitted = [&](int threads) {
    RegistrationOptions options;
    options.threads = threads;
    return register_onto(source, target, {}, options);
  };
  const Alignment alone = found(1);
  REQUIRE(alone.lies_on);
  REQUIRE(alone.map_target.empty() == lacking);
  const Positions by_one = fitted(1);
  for (const int threads : {2, 8}) {
    check_same(found(threads), alone);
    CHECK(fitted(threads) == by_one);
  }
}

TEST_CASE("tiny, flat and torn meshes are registered without failure, a search can be cancelled") {
  const Mesh source = test::beast(3);
  Mesh triangle;
  triangle.positions.resize(3, 3);
  triangle.positions << 0, 0, 0, 1, 0, 0, 0, 2, 0;
  triangle.triangles.resize(1, 3);
  triangle.triangles << 0, 1, 2;
  for (const Mesh& target :
       {triangle, test::sphere(0), test::grid(9, 9, [](double, double) { return 0.0; })}) {
    // However little the shapes have in common, the fitted one lies near the other. The triangle
    // can't bend around a body: it only stays within its size.
    for (const auto& [from, to] : {std::pair(&source, &target), {&target, &source}}) {
      const Positions fitted = register_onto(*from, *to, {}, {});
      CHECK(fitted.allFinite());
      CHECK(mean_distance(fitted, *to) <
            (from->triangle_count() == 1 ? 0.5 : 0.1) * bounding_box_diagonal(to->positions));
    }
  }
  // The source torn apart: no two triangles share a vertex.
  Mesh torn = source;
  torn.positions.resize(3 * Index(source.triangle_count()), 3);
  for (int j = 0; j < source.triangle_count(); ++j)
    for (int k = 0; k < 3; ++k) {
      torn.positions.row(3 * j + k) = source.positions.row(source.triangles(j, k));
      torn.triangles(j, k) = 3 * j + k;
    }
  // It is the same shape in the same place: either one lies on the other as it is.
  CHECK(test::largest_error(register_onto(torn, source, {}, {}), torn.positions) < 1e-9);
  CHECK(test::largest_error(register_onto(source, torn, {}, {}), source.positions) < 1e-9);
  CHECK_THROWS_WITH(align(source, source, {}, 0, [](double done, Stage) { return done < 0.2; }),
                    contains("cancelled"));
}
