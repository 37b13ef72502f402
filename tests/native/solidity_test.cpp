// SPDX-License-Identifier: GPL-3.0-or-later
// Solid limbs: cross-sections that keep their shape, and what must not change.
#include <algorithm>
#include <array>
#include <functional>
#include <numeric>

#include "catch.h"
#include "deform.h"
#include "mesh/measures.h"
#include "mesh/triangles.h"
#include "mesh/unit_box.h"
#include "reconstruction/cross_sections.h"
#include "reconstruction/free_lengths.h"
#include "tapered_limb.h"
#include "triangulations.h"

using namespace dd;
using namespace dd::test;

namespace {

double volume(const TaperedLimb& limb, const Positions& p) {
  return signed_volume(p, limb.mesh.triangles) /
         signed_volume(limb.mesh.positions, limb.mesh.triangles);
}

/// A sheet with relief, which has no inside.
Case relief_sheet() { return lifted_plane(61); }

}  // namespace

TEST_CASE("solid limbs keep sections and volume, twisted, bent and led aside") {
  const double shapes[3][3] = {{0.5, 0.06, 1}, {0.3, 0.3, 1}, {0.5, 0.3, 0.5}};
  for (const auto& shape : shapes)
    for (const int density : {1, 3}) {
      const TaperedLimb limb(shape[0], shape[1], shape[2], density);
      Deformer deformer(limb.mesh, limb.roles, 1, {});
      const auto check = [&](const Affine& motion, const Eigen::Vector3d& turn, double least,
                             double least_volume) {
        const Positions p = surface(deformer, {motion}, solid(1, turn));
        INFO("radius " << shape[0] << ", density " << density << ", turn " << turn.norm());
        CHECK(limb.least_section(p) > least);
        CHECK(volume(limb, p) > least_volume);
        CHECK(measure(limb.mesh, p, std::vector<char>(limb.roles.size(), 1)).intersecting_pairs ==
              0);
      };
      for (const auto& [degrees, least, volume] : {std::array{135.0, 0.98, 0.97},
                                                   {360.0, 0.97, 0.97},
                                                   {720.0, 0.95, 0.95},
                                                   {1080.0, 0.93, 0.95}})
        check(TaperedLimb::twist(degrees), {0, 0, radians(degrees)}, least, volume);
      check(TaperedLimb::led_down(), {0, 0, 0}, 0.97, 0.97);
      for (const double degrees : {70.0, 120.0, 170.0})
        check(TaperedLimb::bend(degrees), {0, radians(degrees), 0}, 0.97, 0.95);
    }
}

TEST_CASE("limbs with sharp ridges, as planks and blades, keep sections and don't fold there") {
  const auto [corners, flatness] = GENERATE(table<int, double>({{4, 0.4}, {6, 0.4}, {3, 1.0}}));
  for (const int density : {1, 3}) {
    INFO(corners << " corners, density " << density);
    const TaperedLimb limb = TaperedLimb(0.4, 0.2, 1, density).with_ridges(corners, flatness);
    Deformer deformer(limb.mesh, limb.roles, 1, {});
    for (const double degrees : {360.0, 720.0}) {
      const Positions p =
          surface(deformer, {TaperedLimb::twist(degrees)}, solid(1, {0, 0, radians(degrees)}));
      CHECK(limb.least_section(p) > 0.97);
      CHECK(measure(limb.mesh, p, std::vector<char>(limb.roles.size(), 1)).intersecting_pairs == 0);
    }
  }
}

TEST_CASE("limbs with bulges, which bend more along them than around, keep sections") {
  for (const int density : {1, 3}) {
    INFO("density " << density);
    const TaperedLimb limb = TaperedLimb(0.4, 0.2, 1, density).with_bulges(0.5);
    Deformer deformer(limb.mesh, limb.roles, 1, {});
    const Positions led = surface(deformer, {TaperedLimb::led_down()}, solid());
    const Positions twisted =
        surface(deformer, {TaperedLimb::twist(360)}, solid(1, {0, 0, radians(360)}));
    CHECK(limb.least_section(led) > 0.93);
    CHECK(limb.least_section(twisted) > 0.87);  // at the root, which is a slab as thick as long
    for (const Positions& p : {led, twisted})
      CHECK(measure(limb.mesh, p, std::vector<char>(limb.roles.size(), 1)).intersecting_pairs == 0);
  }
}

TEST_CASE("a solid limb is twisted evenly along its length, by any angle, also a tapered one") {
  const double shapes[4][4] = {
      {0.3, 0.3, 1, 0}, {0.5, 0.06, 1, 0}, {0.5, 0.3, 0.5, 0}, {0.4, 0.1, 1, 0.08}};
  for (const auto& shape : shapes)
    for (const int density : {1, 3}) {
      const TaperedLimb limb(shape[0], shape[1], shape[2], density, shape[3]);
      Deformer deformer(limb.mesh, limb.roles, 1, {});
      for (const double degrees : {45.0, 90.0, 135.0, 360.0, 720.0, 1080.0}) {
        const Positions p =
            surface(deformer, {TaperedLimb::twist(degrees)}, solid(1, {0, 0, radians(degrees)}));
        INFO("radius " << shape[0] << " to " << shape[1] << ", density " << density << ", "
                       << degrees << " degrees");
        CHECK(limb.unevenness(p, degrees) < 0.04);  // by harmonic weights of a skin 0.2
      }
    }
}

TEST_CASE("solidity leaves rest, rigid motions and scale as they are") {
  const TaperedLimb limb(0.5, 0.06);
  const std::vector<int> held = held_by_one(limb.roles);
  Deformer deformer(limb.mesh, held, 1, {});
  const double box = bounding_box_diagonal(limb.mesh.positions);
  CHECK(largest_difference(surface(deformer, {identity()}, solid()), limb.mesh.positions) <
        1e-12 * box);
  const Affine motion = rotation_about(2.0, {1, 2, 3}, {0.1, 0, 0}, {3, 1, -2});
  CHECK(largest_difference(surface(deformer, {motion}, solid()),
                           transformed(motion, limb.mesh.positions)) < 1e-9 * box);
  Mesh scaled = limb.mesh;
  scaled.positions *= 1e-3;
  Affine small = TaperedLimb::led_down();
  small.col(3) *= 1e-3;
  Deformer of_scaled(scaled, limb.roles, 1, {}), of_limb(limb.mesh, limb.roles, 1, {});
  CHECK(largest_difference(1e3 * surface(of_scaled, {small}, solid()),
                           surface(of_limb, {TaperedLimb::led_down()}, solid())) < 1e-6 * box);
}

TEST_CASE("solidity changes nothing on sheets, and nothing at 0, to the bit") {
  const Case sheet = relief_sheet();
  Deformer of_sheet(sheet.mesh, sheet.roles, 1, {});
  CHECK(
      (surface(of_sheet, {sheet.motion}, solid(1)) == surface(of_sheet, {sheet.motion}, usual())));
  const TaperedLimb limb(0.5, 0.06);
  Deformer deformer(limb.mesh, limb.roles, 1, {});
  const Positions before = surface(deformer, {TaperedLimb::led_down()}, usual());
  CHECK(largest_difference(surface(deformer, {TaperedLimb::led_down()}, solid(1)), before) > 0.1);
  CHECK((surface(deformer, {TaperedLimb::led_down()}, solid(0)) == before));
}

TEST_CASE("solidity acts evenly from 0 to 1, and on parts whose triangles face inwards") {
  const TaperedLimb limb(0.3, 0.3);
  Deformer deformer(limb.mesh, limb.roles, 1, {});
  std::vector<double> volumes;
  for (const double solidity : {0.0, 0.3, 0.6, 1.0})
    volumes.push_back(volume(limb, surface(deformer, {TaperedLimb::led_down()}, solid(solidity))));
  for (size_t k = 1; k < volumes.size(); ++k) CHECK(volumes[k] > volumes[k - 1]);
  Mesh inside_out = limb.mesh;
  inside_out.triangles.col(1).swap(inside_out.triangles.col(2));
  Deformer of_it(inside_out, limb.roles, 1, {});
  CHECK(largest_difference(surface(of_it, {TaperedLimb::led_down()}, solid()),
                           surface(deformer, {TaperedLimb::led_down()}, solid())) < 0.01);
}

TEST_CASE("a solid limb follows a drag without jumps, also where the gauge begins") {
  const TaperedLimb limb(0.5, 0.06);
  Deformer deformer(limb.mesh, limb.roles, 1, {});
  const auto largest_step = [&](const std::function<Positions(double)>& at) {
    Positions last = at(0);
    double largest = 0, sum = 0;
    constexpr int kMoves = 100;
    for (int k = 1; k <= kMoves; ++k) {
      const Positions now = at(double(k) / kMoves);
      const double step = largest_difference(now, last);
      largest = std::max(largest, step);
      sum += step / kMoves;
      last = now;
    }
    return largest / sum;
  };
  const auto twisted = [&](double degrees, double solidity, BaseDeformer base) {
    UpdateOptions options = solid(solidity, {0, 0, radians(degrees)});
    options.base_deformer = base;
    return surface(deformer, {TaperedLimb::twist(degrees)}, options);
  };
  CHECK(largest_step([&](double s) { return twisted(1080 * s, 1, BaseDeformer::automatic); }) < 2);
  CHECK(largest_step([&](double s) { return twisted(360 * s, 1, BaseDeformer::motions); }) < 2);
  for (const double degrees : {90.0, 1080.0})  // with more and more solidity, which slows down
    CHECK(largest_step([&](double s) { return twisted(degrees, s, BaseDeformer::automatic); }) < 3);
  CHECK(largest_step([&](double s) {
          Affine motion = TaperedLimb::led_down();
          motion.col(3) *= s;
          return surface(deformer, {motion}, solid());
        }) < 2);
  CHECK(largest_step([&](double s) {  // bent and twisted
          const Affine bend = TaperedLimb::bend(120 * s), twist = TaperedLimb::twist(240 * s);
          Affine motion = bend;
          motion.leftCols<3>() = bend.leftCols<3>() * twist.leftCols<3>();
          return surface(deformer, {motion}, solid(1, {0, 0, radians(240 * s)}));
        }) < 2);
}

TEST_CASE("solid limbs do not depend on the number of threads", "[threads]") {
  const TaperedLimb limb(0.5, 0.06, 1, 3);
  BindOptions one, two;
  one.threads = 1;
  two.threads = 2;
  Deformer by_one(limb.mesh, limb.roles, 1, one), by_two(limb.mesh, limb.roles, 1, two);
  CHECK((surface(by_one, {TaperedLimb::led_down()}, solid()) ==
         surface(by_two, {TaperedLimb::led_down()}, solid())));
}

TEST_CASE("sections lie in their own part, and arms reach the axis") {
  const TaperedLimb limb(0.3, 0.3);
  // A second tube around the first one, whose rays must not meet it.
  const TaperedLimb around(0.5, 0.5);
  const Mesh both = appended(limb.mesh, around.mesh);
  std::vector<int> roles = limb.roles;
  roles.insert(roles.end(), around.roles.begin(), around.roles.end());
  const Region region = region_of_roles(roles, 1);
  FactoredSurface surface(both, region);
  ThreadPool pool(1);
  BlockOptions options;
  options.pool = &pool;
  surface.factor(free_block(surface.operators.laplacian, region), options);
  const auto sections = find_cross_sections(surface);
  REQUIRE(sections);
  const FreeLengths free = free_lengths(surface);
  for (int i = 0; i < surface.poisson->active_vertex_count(); ++i) {
    double sum = 0;
    const int v = surface.poisson->active_vertex(i);
    const bool is_inner = v < limb.mesh.vertex_count();
    for (const auto& [index, weight] : sections->means[size_t(i)]) {
      sum += weight;
      CHECK((surface.poisson->active_vertex(index) < limb.mesh.vertex_count()) == is_inner);
    }
    CHECK(sum == Approx(1));
    const Eigen::RowVector3d centre = both.positions.row(v) - sections->arms.row(i);
    CHECK(centre.head<2>().norm() < 0.1 * (is_inner ? 0.3 : 0.5));
    CHECK(std::abs(sections->axes(i, 2)) > 0.98);
    // Free from a tenth of the length to nine tenths. Paths along edges may be slightly longer.
    const double z = both.positions(v, 2) / TaperedLimb::kLength;
    CHECK(free.lengths[i] == Approx(0.8 * TaperedLimb::kLength).epsilon(0.05));
    CHECK(free.depths[i] ==
          Approx(TaperedLimb::kLength * std::min(z - 0.1, 0.9 - z)).epsilon(0.05).margin(0.1));
  }
}

TEST_CASE("a body is no limb: a slab that is cut out of it") {
  const TaperedLimb body(0.5, 0.5);
  std::vector<int> roles;
  for (Index v = 0; v < body.mesh.positions.rows(); ++v) {
    const double z = body.mesh.positions(v, 2) / TaperedLimb::kLength;
    roles.push_back(z < 0.4 ? kFixed : z > 0.6 ? 0 : kFree);
  }
  Deformer deformer(body.mesh, roles, 1, {});
  const Affine motion = rotation_about(radians(40), {0, 1, 0}, {0, 0, 2}, {0.3, 0, 0.1});
  CHECK(largest_difference(surface(deformer, {motion}, solid()),
                           surface(deformer, {motion}, usual())) < 0.01);  // solid, it would be 0.1
}

TEST_CASE("sections of a surface whose edges were flipped at its rims") {
  // Faces there have corners that no active triangle has.
  TaperedLimb limb(0.5, 0.3, 1, 1, 0.1);
  limb.mesh = with_slivers(limb.mesh, 0.05);
  for (Index v = 0; v < limb.mesh.positions.rows(); ++v) {
    const Eigen::RowVector3d p = limb.mesh.positions.row(v);
    const double along = p[2] / TaperedLimb::kLength + 0.05 * p[0];
    limb.roles[size_t(v)] = along < 0.1 ? kFixed : along > 0.9 ? 0 : kFree;
  }
  Deformer deformer(limb.mesh, limb.roles, 1, {});
  CHECK(limb.least_section(surface(deformer, {TaperedLimb::led_down()}, solid())) > 0.9);
}

TEST_CASE("a limb led within a plane by a handle that only places stays in it and does not roll") {
  const double shapes[4][3] = {{0.5, 0.06, 1}, {0.3, 0.3, 1}, {0.5, 0.3, 0.5}, {0.06, 0.06, 0.3}};
  for (const auto& shape : shapes)
    for (const int density : {1, 2, 3})
      for (const bool symmetric : {true, false}) {
        const TaperedLimb quads_cut_alike(shape[0], shape[1], shape[2], density);
        const TaperedLimb limb = symmetric ? quads_cut_alike.symmetric() : quads_cut_alike;
        Deformer deformer(limb.mesh, limb.roles, 1, {});
        for (const auto& [aside, down] : {std::array{0.2, 0.05}, {0.5, 0.3}, {0.7, 0.7}}) {
          UpdateOptions options = solid();
          options.free = {1};
          Affine motion = identity();
          motion.col(3) << 0, aside * TaperedLimb::kLength, -down * TaperedLimb::kLength;
          std::vector<double> turns;
          const std::vector<double> found =
              deformer.completed_matrices(motion.data(), options, turns);
          // Row by row: the turn keeps the direction of x, across the plane.
          INFO("radius " << shape[0] << " to " << shape[1] << " by " << shape[2] << ", density "
                         << density << ", symmetric " << symmetric << ", aside by " << aside);
          CHECK(std::hypot(found[4], found[8]) < (symmetric ? 1e-9 : 5e-4));
          CHECK(found[5] < 0.95);  // it does turn about x
          const Positions p = surface(deformer, {motion}, options);
          double farthest = 0;
          for (int ring = 0; ring < limb.rings; ++ring)
            farthest = std::max(
                farthest,
                std::abs(p.middleRows(Index(ring) * limb.sides, limb.sides).col(0).mean()));
          // A ribbon's coarse level is not symmetric, nor are the planes of a flat limb's quads.
          const bool coarse = density == 3 && shape[0] < 0.1;
          const double most = coarse ? 5e-4 : symmetric ? 1e-9 : shape[2] == 1.0 ? 2e-6 : 5e-5;
          CHECK(farthest < most * TaperedLimb::kLength);
        }
      }
}

TEST_CASE("a refined limb is as far as ten times the iterations would take it") {
  for (const Case& one : {bent_cylinder(), twisted_bar()}) {
    Deformer deformer(one.mesh, one.roles, 1, {});
    UpdateOptions options = solid();
    const Positions few = surface(deformer, {one.motion}, options);
    options.of_method.refined.iterations = 40;
    const Positions many = surface(deformer, {one.motion}, options);
    INFO(one.name);
    CHECK((few - many).rowwise().norm().maxCoeff() <
          0.015 * bounding_box_diagonal(one.mesh.positions));
  }
}

TEST_CASE("a solid bar whose ends are turned against each other is twisted without jumps") {
  Case bar = twisted_bar();
  const Eigen::VectorXd z = bar.mesh.positions.col(2);
  for (Index v = 0; v < z.size(); ++v) {
    const double along = (z[v] - z.minCoeff()) / (z.maxCoeff() - z.minCoeff());
    bar.roles[size_t(v)] = along > 0.9 ? 0 : along < 0.1 ? 1 : kFree;
  }
  Deformer deformer(bar.mesh, bar.roles, 2, {});
  std::vector<double> steps;
  Positions last;
  for (int i = 0; i <= 60; ++i) {  // the gauge begins at 30°
    const double angle = radians(1.5 * i);
    UpdateOptions options = solid();
    options.turns = {0, 0, angle, 0, 0, -angle};
    const auto turned = [](double by) {
      return rotation_about(by, {0, 0, 1}, {0, 0, 0}, {0, 0, 0});
    };
    const Positions now = surface(deformer, {turned(angle), turned(-angle)}, options);
    if (i > 0) steps.push_back((now - last).rowwise().norm().maxCoeff());
    last = now;
  }
  const double largest = *std::max_element(steps.begin(), steps.end());
  CHECK(largest < 1.3 * std::accumulate(steps.begin(), steps.end(), 0.0) / double(steps.size()));
}
