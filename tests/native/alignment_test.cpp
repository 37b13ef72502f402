// SPDX-License-Identifier: GPL-3.0-or-later
#include "transfer/alignment.h"

#include <algorithm>
#include <cmath>

#include "catch.h"
#include "mesh/aabb_tree.h"
#include "mesh/triangles.h"
#include "mesh/unit_box.h"
#include "meshes.h"
#include "random_meshes.h"
#include "support/rotations.h"
#include "transfer/functional_map.h"
#include "transfer/limb_tips.h"
#include "transfer/registration.h"
#include "transfer/spectral_basis.h"
#include "transfer/triangle_match.h"

using namespace dd;

namespace {

double beast_radius(const Eigen::RowVector3d& direction) {
  const Eigen::RowVector3d limbs[5] = {
      {1, 0.1, 0.3}, {-0.8, 0.5, -0.2}, {0.1, -1, 0.4}, {-0.3, 0.2, 1}, {0.4, 0.7, -0.7}};
  const double lengths[5] = {2.4, 1.6, 1.1, 0.8, 0.6};
  double radius = 0.7;
  for (int k = 0; k < 5; ++k)
    radius += lengths[k] * std::exp(-12 * (direction - limbs[k].normalized()).squaredNorm());
  return radius;
}

/// A body of a sphere's topology with five limbs, none like another, about which nothing is
/// symmetric.
Mesh beast(int levels) {
  Mesh mesh = test::sphere(levels);
  for (Index v = 0; v < mesh.positions.rows(); ++v)
    mesh.positions.row(v) *= beast_radius(mesh.positions.row(v));
  return mesh;
}

constexpr double kCavity = 0.45;  // its radius

/// The same with a narrow opening and a cavity behind it.
Mesh hollow(int levels) {
  Mesh mesh = test::sphere(levels);
  const Eigen::Vector3d opening = Eigen::Vector3d(-0.5, -0.5, -0.7).normalized();
  constexpr double kInside = 1.3, kRim = 0.2;  // angles from there: on the sphere, at the opening
  for (Index v = 0; v < mesh.positions.rows(); ++v) {
    const Eigen::Vector3d direction = mesh.positions.row(v).transpose();
    const double angle = std::acos(std::clamp(direction.dot(opening), -1.0, 1.0));
    const Eigen::Vector3d side = (direction - direction.dot(opening) * opening).normalized();
    const bool inside = angle < kInside;
    const double moved = inside ? kPi + (kRim - kPi) * angle / kInside
                                : kPi + (kRim - kPi) * (kPi - angle) / (kPi - kInside);
    const Eigen::Vector3d there = std::cos(moved) * opening + std::sin(moved) * side;
    const double wall = beast_radius(there.transpose());
    const double depth = std::clamp((kInside - angle) / 0.1, 0.0, 1.0);
    mesh.positions.row(v) = (wall + depth * (kCavity - wall)) * there.transpose();
  }
  return mesh;
}

/// The same with two long legs beside each other.
Mesh forked(int levels) {
  Mesh mesh = beast(levels);
  for (Index v = 0; v < mesh.positions.rows(); ++v) {
    auto p = mesh.positions.row(v);
    const Eigen::RowVector3d direction = p.normalized();
    for (double side : {-1, 1})
      p += 2.5 * direction *
           std::exp(
               -20 *
               (direction - Eigen::RowVector3d(-0.4, 0.35 * side, -1).normalized()).squaredNorm());
  }
  return mesh;
}

/// The legs turned aside, in y, by 75°.
Positions aside(const Positions& p) {
  Positions result = p;
  for (Index v = 0; v < p.rows(); ++v) {
    const double share = std::clamp(-p(v, 2) - 0.6, 0.0, 0.8) / 0.8;
    const double turn = 1.3 * share * share * (3 - 2 * share);
    const double y = p(v, 1), z = p(v, 2) + 0.8;
    result(v, 1) = std::cos(turn) * y - std::sin(turn) * z;
    result(v, 2) = std::sin(turn) * y + std::cos(turn) * z - 0.8;
  }
  return result;
}

/// Its longest limb, along x, bent upwards.
Positions raised(const Positions& p, double curvature) {
  Positions result = p;
  for (Index v = 0; v < p.rows(); ++v) {
    const double along = std::max(0.0, p(v, 0) - 0.8), radius = 1 / curvature - p(v, 2);
    if (along == 0) continue;
    result(v, 0) = 0.8 + radius * std::sin(curvature * along);
    result(v, 2) = 1 / curvature - radius * std::cos(curvature * along);
  }
  return result;
}

Positions turned(const Positions& p, double angle) {
  return test::transformed(test::rotation_about(angle, {1, 2, 3}, {0, 0, 0}, {5, -2, 1}), p);
}

/// Of the box, the mean distance between where a source was brought to and where it belongs.
double error(const Positions& fitted, const Positions& truth) {
  return (fitted - truth).rowwise().norm().mean() / bounding_box_diagonal(truth);
}

/// The same of some vertices.
template <class Has>
double error(const Positions& fitted, const Positions& truth, const Has& has) {
  double sum = 0;
  int count = 0;
  for (Index v = 0; v < truth.rows(); ++v) {
    if (!has(v)) continue;
    sum += (fitted.row(v) - truth.row(v)).norm();
    ++count;
  }
  return sum / count / bounding_box_diagonal(truth);
}

/// To the bit.
void check_same(const Alignment& a, const Alignment& b) {
  CHECK(a.placement.rotation == b.placement.rotation);
  CHECK(a.placement.scale == b.placement.scale);
  CHECK(a.placement.shift == b.placement.shift);
  CHECK(a.partner == b.partner);
  CHECK(a.lies_on == b.lies_on);
  CHECK(a.ambiguous == b.ambiguous);
}

double largest_error(const Positions& fitted, const Positions& truth) {
  return (fitted - truth).rowwise().norm().maxCoeff() / bounding_box_diagonal(truth);
}

}  // namespace

TEST_CASE("the smoothest functions of a sphere are the spherical harmonics") {
  const Mesh ball = test::sphere(4);
  std::vector<int> seeds;
  for (int v = 0; v < 40; ++v) seeds.push_back(v * 25);
  const SpectralBasis basis = spectral_basis(ball, 16, seeds, nullptr);
  // l (l + 1), 2 l + 1 times each, of a sphere of area 1.
  int k = 0;
  for (int degree = 0; degree < 4; ++degree)
    for (int order = 0; order < 2 * degree + 1; ++order, ++k)
      CHECK(basis.values[k] ==
            Approx(4 * std::acos(-1.0) * degree * (degree + 1)).epsilon(0.02).margin(1e-8));
  // Those of degree 1 are the coordinates.
  const Eigen::MatrixXd linear = basis.functions.middleCols(1, 3);
  for (int c = 0; c < 3; ++c) {
    const Eigen::VectorXd coordinate = ball.positions.col(c);
    const Eigen::VectorXd share = linear.colPivHouseholderQr().solve(coordinate);
    CHECK((linear * share - coordinate).norm() < 0.01 * coordinate.norm());
  }
}

TEST_CASE("nearest rows are those of a search through all") {
  const RowMatrix first = RowMatrix::Random(150, 7), second = RowMatrix::Random(90, 7);
  const NearestRows found = nearest_rows(first, second);
  for (Index i = 0; i < first.rows(); ++i) {
    Index best = 0;
    (second.rowwise() - first.row(i)).rowwise().norm().minCoeff(&best);
    CHECK(found.of_first[size_t(i)] == best);
  }
  for (Index j = 0; j < second.rows(); ++j) {
    Index best = 0;
    (first.rowwise() - second.row(j)).rowwise().norm().minCoeff(&best);
    CHECK(found.of_second[size_t(j)] == best);
  }
}

TEST_CASE("a copy that was moved, turned, scaled and renumbered is found without markers",
          "[large]") {
  const Mesh source = beast(4);
  for (double angle : {0.0, 0.3, 1.7, 3.0}) {
    const test::Renumbered other =
        test::renumbered({40 * turned(source.positions, angle), source.triangles},
                         std::vector<int>(size_t(source.vertex_count()), 0));
    const Positions truth = 40 * turned(source.positions, angle);
    const Alignment found = align(source, other.mesh, {});
    CHECK_FALSE(found.ambiguous);
    CHECK(found.placement.scale == Approx(40).epsilon(1e-3));
    CHECK(largest_error(register_onto(source, other.mesh, {}, found, {}), truth) < 1e-3);
  }
}

TEST_CASE("a mesh of other triangles on the same surface is found without markers", "[large]") {
  const Mesh source = beast(4);
  for (int levels : {3, 5}) {
    const Mesh target = {turned(beast(levels).positions, 2), beast(levels).triangles};
    const Positions fitted = register_onto(source, target, {}, {});
    CHECK(error(fitted, turned(source.positions, 2)) < (levels == 3 ? 0.01 : 2e-3));
    const Match match = match_triangles({fitted, source.triangles}, target, 0.1);
    for (int j = 0; j < target.triangle_count(); ++j) CHECK(match.correspondence.has_source(j));
  }
}

TEST_CASE("two legs, one of which stands where the other stood, are told apart", "[large]") {
  const Mesh source = forked(5);
  const Positions truth = aside(source.positions);
  const Mesh target = {aside(forked(4).positions), forked(4).triangles};
  const auto is_of_leg = [&](Index v) { return source.positions(v, 2) < -1.2; };
  const Positions by_functions = register_onto(source, target, {}, {});
  CHECK(error(by_functions, truth) < 0.015);
  CHECK(error(by_functions, truth, is_of_leg) < 0.03);
  // Nearest points alone take one for the other.
  Alignment placed = align(source, target, {});
  REQUIRE(placed.lies_on);
  placed.partner.clear();
  placed.lies_on = false;
  CHECK(error(register_onto(source, target, {}, placed, {}), truth, is_of_leg) > 0.1);
}

namespace {

/// Ways in which a quadruped's legs, head and tail point.
constexpr double kLimbs[6][3] = {{0.7, 0.35, -1},   {0.7, -0.35, -1}, {-0.7, 0.35, -1},
                                 {-0.7, -0.35, -1}, {1, 0, 0.7},      {-1, 0, 0.5}};

/// A body on four legs with a head and a tail, its left half like its right one.
Mesh quadruped(int levels, double legs = 2, double neck = 1.6) {
  const double lengths[6] = {legs, legs, legs, legs, neck, 1.2};
  Mesh mesh = test::sphere(levels);
  for (Index v = 0; v < mesh.positions.rows(); ++v) {
    const Eigen::RowVector3d direction = mesh.positions.row(v);
    double radius = 0.7;
    for (int k = 0; k < 6; ++k) {
      const Eigen::RowVector3d way(kLimbs[k][0], kLimbs[k][1], kLimbs[k][2]);
      radius += lengths[k] * std::exp(-20 * (direction - way.normalized()).squaredNorm());
    }
    mesh.positions.row(v) *= radius;
    mesh.positions(v, 0) *= 1.3;
  }
  return mesh;
}

/// Its legs swung about y, left and right and fore and hind the other way.
Positions striding(const Positions& p, double angle) {
  Positions result = p;
  for (Index v = 0; v < p.rows(); ++v) {
    const double share = std::clamp(-p(v, 2) - 0.5, 0.0, 0.6) / 0.6;
    const double fore = p(v, 0) > 0 ? 1 : -1, left = p(v, 1) > 0 ? 1 : -1;
    const double turn = fore * left * angle * share * share * (3 - 2 * share);
    const double x = p(v, 0) - fore * 0.8, z = p(v, 2) + 0.5;
    result(v, 0) = std::cos(turn) * x + std::sin(turn) * z + fore * 0.8;
    result(v, 2) = -std::sin(turn) * x + std::cos(turn) * z - 0.5;
  }
  return result;
}

}  // namespace

TEST_CASE("three markers lose nothing of what the shapes tell", "[large]") {
  const auto farthest = [](const Mesh& mesh, const Eigen::RowVector3d& way) {
    Index v = 0;
    (mesh.positions * way.transpose()).maxCoeff(&v);
    return static_cast<int>(v);
  };
  const auto marked = [&](const Mesh& mesh, const std::vector<Eigen::RowVector3d>& ways) {
    Pairs markers;  // of vertices that a finer sphere has, too
    for (const auto& way : ways) markers.push_back({farthest(mesh, way), farthest(mesh, way)});
    return markers;
  };
  // On feet that a stride has turned by 57°: no turn and size takes them where they belong.
  const Mesh rest = quadruped(4);
  const Mesh source = {striding(quadruped(5).positions, 1), quadruped(5).triangles};
  for (const Eigen::RowVector3d& third :
       {Eigen::RowVector3d(0.7, -0.35, -1), Eigen::RowVector3d(1, 0, 0.7)}) {
    const Pairs markers = marked(rest, {{0.7, 0.35, -1}, {-0.7, -0.35, -1}, third});
    CHECK(error(register_onto(source, rest, markers, {}), quadruped(5).positions) < 0.02);
  }
  // On limbs of which one is bent, where no map helps: by themselves they would shear the body.
  const Mesh straight = beast(5);
  const Mesh bent = {raised(beast(4).positions, 0.35), beast(4).triangles};
  const Pairs markers = marked(beast(4), {{1, 0.1, 0.3}, {-0.8, 0.5, -0.2}, {0.1, -1, 0.4}});
  Alignment placed = align(straight, bent, markers);
  placed.partner.clear();
  placed.lies_on = false;
  CHECK(error(register_onto(straight, bent, markers, placed, {}),
              raised(straight.positions, 0.35)) < 0.01);
}

TEST_CASE("limbs end where they are farthest from the whole, and are told from one another") {
  const int levels[2] = {5, 4};
  const Mesh shapes[2] = {quadruped(5), quadruped(4, 3.5, 2.5)};
  const CoarseShape coarse[2] = {CoarseShape(shapes[0]), CoarseShape(shapes[1])};
  // The vertex at the end of each limb.
  int ends[2][6];
  for (int side = 0; side < 2; ++side) {
    const Positions ways = test::sphere(levels[side]).positions;
    for (int k = 0; k < 6; ++k) {
      Index v = 0;
      (ways * Eigen::Vector3d(kLimbs[k][0], kLimbs[k][1], kLimbs[k][2])).maxCoeff(&v);
      ends[side][k] = static_cast<int>(v);
    }
    CHECK(limb_tips(coarse[side].mesh, coarse[side].samples).size() >= 6);
  }
  const auto limb_of = [&](int side, int tip) {
    const Positions& p = shapes[side].positions;
    const auto way = [&](int end) {
      return (p.row(coarse[side].vertices[size_t(tip)]) - p.row(end)).norm();
    };
    const int* nearest =
        std::min_element(ends[side], ends[side] + 6, [&](int a, int b) { return way(a) < way(b); });
    CHECK(way(*nearest) < 0.6);  // of some 6 from end to end
    return nearest - ends[side];
  };
  const Pairs pairs = paired_tips(coarse[0], coarse[1], {}, {});
  CHECK(pairs.size() == 6);
  for (const auto& [one, other] : pairs) CHECK(limb_of(0, one) == limb_of(1, other));
  // What is marked is left out, and leaves the rest as it is.
  const Pairs others = paired_tips(coarse[0], coarse[1], {}, {pairs[0]});
  CHECK(others.size() == 5);
  for (const std::array<int, 2>& pair : others)
    CHECK(std::count(pairs.begin(), pairs.end(), pair) == 1);
  const CoarseShape ball(test::sphere(4));
  CHECK(limb_tips(ball.mesh, ball.samples).empty());
  CHECK(paired_tips(ball, coarse[1], {}, {}).empty());
}

TEST_CASE("limbs of other lengths are found without markers", "[large]") {
  const Mesh low = quadruped(5), tall = quadruped(4, 3.5, 2.5);
  const Positions truth = quadruped(5, 3.5, 2.5).positions;
  Alignment found = align(low, tall, {});
  CHECK(found.tips.size() == 6);
  const double by_tips = error(register_onto(low, tall, {}, found, {}), truth);
  CHECK(by_tips < 0.04);
  // Paired wrongly they lose nothing: what they lead to isn't trusted.
  std::swap(found.tips[0][1], found.tips[1][1]);
  const double astray = error(register_onto(low, tall, {}, found, {}), truth);
  found.tips.clear();
  const double without = error(register_onto(low, tall, {}, found, {}), truth);
  CHECK(by_tips < 0.85 * without);
  CHECK(astray <= without);
}

TEST_CASE("what a remesh lacks, as the inside of a mouth, leaves the rest where it belongs",
          "[large]") {
  const Mesh source = hollow(5), closed = beast(4);
  const Mesh target = {3 * turned(closed.positions, 2), closed.triangles};
  const Positions truth = 3 * turned(source.positions, 2);
  const Alignment lying = align(source, target, {});
  REQUIRE(lying.lies_on);
  CHECK_FALSE(lying.ambiguous);
  CHECK(error(lying.placement.all(source.positions), truth) < 2e-3);
  const auto fitted = [&](const Alignment& alignment) {
    return register_onto(source, target, {}, alignment, {});
  };
  const auto error_outside = [&](const Positions& p) {
    const auto is_outside = [&](Index v) { return source.positions.row(v).norm() > 1.1 * kCavity; };
    return error(p, truth, is_outside);
  };
  const Positions found = fitted(lying);
  CHECK(error_outside(found) < 5e-3);
  // What has no counterpart would drag the rest along.
  Alignment by_all = lying;
  by_all.lies_on = false;
  CHECK(error_outside(fitted(by_all)) > 2.5 * error_outside(found));
}

TEST_CASE("what lies on another in parts, turned too, stands as it was where it fits best") {
  const auto ball = [](double x, double y, double radius) {
    Mesh mesh = test::sphere(2);
    mesh.positions *= radius;
    mesh.positions.col(2) *= 3;
    mesh.positions.rowwise() += Eigen::RowVector3d(x, y, 0);
    return mesh;
  };
  Mesh legs = ball(1, 1, 0.2);
  for (const auto& [x, y] : {std::pair{1, -1}, {-1, 1}, {-1, -1}})
    legs = test::appended(legs, ball(x, y, 0.2));
  const auto shaken = [](Mesh mesh) {
    for (Index i = 0; i < mesh.positions.size(); ++i)
      mesh.positions.data()[i] += 1e-4 * std::sin(7.0 * static_cast<double>(i));
    return mesh;
  };
  const Alignment alike = align(legs, shaken(legs), {});
  CHECK(alike.lies_on);
  CHECK(alike.ambiguous);
  CHECK(alike.placement.rotation.isIdentity(1e-3));
  const Mesh table = test::appended(legs, ball(1, 0.3, 0.15));
  const Alignment found = align(table, shaken(table), {});
  CHECK(found.lies_on);
  CHECK_FALSE(found.ambiguous);
  CHECK(found.placement.rotation.isIdentity(1e-3));
  // A marker has more to say: a leg on the next one.
  const Alignment marked = align(legs, shaken(legs), {{0, legs.vertex_count() / 4}});
  CHECK(marked.lies_on);
  CHECK_FALSE(marked.placement.rotation.isIdentity(0.5));
}

TEST_CASE("a part that was cut off is found where it stands, as the whole is by the part") {
  const Mesh whole = beast(4);
  std::vector<char> keep;
  for (int j = 0; j < whole.triangle_count(); ++j)
    keep.push_back(triangle_centre(whole.positions, whole.triangles, j)[0] > 0.5);
  const Mesh part = test::kept(whole, keep);
  REQUIRE(part.triangle_count() < whole.triangle_count() / 4);
  for (const bool back : {false, true}) {
    const Mesh &source = back ? part : whole, &target = back ? whole : part;
    const Alignment found = align(source, target, {});
    CHECK(found.lies_on);
    CHECK_FALSE(found.ambiguous);
    CHECK(largest_error(found.placement.all(source.positions), source.positions) < 1e-9);
    const AabbTree there(target);
    const auto has_a_counterpart = [&](Index v) {
      return there.nearest(source.positions.row(v).transpose(), 1e-6, [](int) { return true; })
                 .triangle >= 0;
    };
    const Positions fitted = register_onto(source, target, {}, found, {});
    CHECK(error(fitted, source.positions, has_a_counterpart) < 1e-3);
  }
  // By a marker at another place it doesn't stand where it belongs.
  Index low = 0;
  whole.positions.col(0).minCoeff(&low);
  const Alignment marked = align(whole, part, {{static_cast<int>(low), 0}});
  CHECK(largest_error(marked.placement.all(whole.positions), whole.positions) > 0.05);
}

TEST_CASE("akin shapes find one another without markers", "[large]") {
  const Mesh source = beast(4), target = beast(5);
  const auto fatter = [](Positions p) {
    for (Index v = 0; v < p.rows(); ++v) p.row(v) *= 1 + 0.15 * std::sin(2 * p(v, 0) + p(v, 1));
    p.col(1) *= 1.2;
    return p;
  };
  const Mesh other = {fatter(target.positions), target.triangles};
  CHECK(error(register_onto(source, other, {}, {}), fatter(source.positions)) < 0.02);
}

TEST_CASE("the result depends neither on units nor on numbering nor on where the source lies",
          "[large]") {
  const Mesh source = beast(3), target = {raised(beast(4).positions, 0.5), beast(4).triangles};
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

TEST_CASE("what fits about as well turned is told, stands as it was, and goes by a marker",
          "[large]") {
  // A box with a square base: a quarter turn is as good.
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
  CHECK_FALSE(align(beast(4), beast(3), {}).ambiguous);
}

TEST_CASE("small sheets find one another: what faces nothing fits no better for it") {
  const auto height = [](double x, double y) {
    return 0.3 * x * x + 0.2 * y * y * y - 0.2 * x * y;
  };
  for (const int side : {3, 5, 9, 20}) {
    const Mesh source = test::grid(side, side + 2, height);
    const Mesh flat = test::grid(side + 1, side + 3, height);
    for (const double angle : {0.0, 2.0}) {
      const Mesh target = {turned(flat.positions, angle), flat.triangles};
      const Positions fitted = register_onto(source, target, {}, {});
      CHECK(error(fitted, turned(source.positions, angle)) < 0.02);
      const Match match = match_triangles({fitted, source.triangles}, target, 0.1);
      for (int j = 0; j < target.triangle_count(); ++j) CHECK(match.correspondence.has_source(j));
    }
  }
}

TEST_CASE("the number of threads changes nothing of a match without markers", "[threads][large]") {
  const Mesh posed = forked(3), whole = hollow(3);
  const bool lacking = GENERATE(false, true);
  const Mesh source = lacking ? whole : posed;
  const Mesh target = lacking ? beast(4) : Mesh{aside(posed.positions), posed.triangles};
  const auto found = [&](int threads) { return align(source, target, {}, threads); };
  const auto fitted = [&](int threads) {
    RegistrationOptions options;
    options.threads = threads;
    return register_onto(source, target, {}, options);
  };
  const Alignment alone = found(1);
  REQUIRE(alone.lies_on);
  REQUIRE(alone.partner.empty() == lacking);
  const Positions by_one = fitted(1);
  for (const int threads : {2, 8}) {
    check_same(found(threads), alone);
    CHECK(fitted(threads) == by_one);
  }
}

TEST_CASE("few, small, flat and torn meshes are placed or refused, and a search ends when told") {
  const Mesh source = beast(3);
  Mesh triangle;
  triangle.positions.resize(3, 3);
  triangle.positions << 0, 0, 0, 1, 0, 0, 0, 2, 0;
  triangle.triangles.resize(1, 3);
  triangle.triangles << 0, 1, 2;
  for (const Mesh& target :
       {triangle, test::sphere(0), test::grid(9, 9, [](double, double) { return 0.0; })}) {
    CHECK(register_onto(source, target, {}, {}).allFinite());
    CHECK(register_onto(target, source, {}, {}).allFinite());
  }
  // Each triangle by itself.
  Mesh torn = source;
  torn.positions.resize(3 * Index(source.triangle_count()), 3);
  for (int j = 0; j < source.triangle_count(); ++j)
    for (int k = 0; k < 3; ++k) {
      torn.positions.row(3 * j + k) = source.positions.row(source.triangles(j, k));
      torn.triangles(j, k) = 3 * j + k;
    }
  CHECK(register_onto(torn, source, {}, {}).allFinite());
  CHECK(register_onto(source, torn, {}, {}).allFinite());
  CHECK_THROWS_WITH(
      align(source, source, {}, 0, [](double done, const char*) { return done < 0.2; }),
      contains("cancelled"));
}
