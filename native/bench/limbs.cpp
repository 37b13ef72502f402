// SPDX-License-Identifier: GPL-3.0-or-later
// Limbs with and without solidity: the least area of a cross-section over that at rest, the volume,
// stretch, intersecting faces, and the times of an update and of the first one, which finds the
// sections.
//
//   limbs [density]     1: 1,682 vertices; 5: 42,002
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "cases.h"
#include "deform/deformer.h"
#include "mesh/measures.h"
#include "timing.h"

namespace {

using dd::Index;
using dd::Positions;
using dd::bench::milliseconds;
using dd::test::Affine;
using dd::test::radians;

constexpr double kLength = 4;

struct Limb {
  std::string name;
  int rings, sides;
  dd::Mesh mesh;
  Limb(std::string its_name, int density, double bottom, double top, double flatness, double relief)
      : name(std::move(its_name)),
        rings(60 * density),
        sides(28 * density),
        mesh(dd::test::tube(rings, sides, [=](double u, double v) {
          const double radius =
              (bottom + (top - bottom) * u) * (1 + relief * std::sin(9 * v) * std::sin(60 * u));
          return Eigen::RowVector3d(radius * std::cos(v), flatness * radius * std::sin(v),
                                    kLength * u);
        })) {}

  double section(const Positions& p, int ring) const {
    const Positions points = p.middleRows(Index(ring) * sides, sides);
    const Eigen::RowVector3d centre = points.colwise().mean();
    Eigen::RowVector3d sum = Eigen::RowVector3d::Zero();
    for (int j = 0; j < sides; ++j)
      sum += (points.row(j) - centre).cross(points.row((j + 1) % sides) - centre);
    return sum.norm() / 2;
  }
  double least_section(const Positions& p) const {
    double least = 1e9;
    for (int ring = 0; ring < rings; ++ring)
      least = std::min(least, section(p, ring) / section(mesh.positions, ring));
    return least;
  }
};

struct Motion {
  std::string name;
  Affine matrix;
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();
};

std::vector<Motion> motions() {
  std::vector<Motion> all;
  for (const double degrees : {135.0, 360.0, 720.0, 1080.0})
    all.push_back({"twisted " + std::to_string(int(degrees)),
                   dd::test::rotation_about(radians(degrees), {0, 0, 1}, {0, 0, 0}, {0, 0, 0}),
                   {0, 0, radians(degrees)}});
  Affine led = dd::test::identity();
  led.col(3) << 0, 0.7 * kLength, -0.7 * kLength;
  all.push_back({"led down", led});
  for (const double degrees : {70.0, 120.0, 170.0})
    all.push_back({"bent " + std::to_string(int(degrees)),
                   dd::test::bend(degrees, 0.19 * kLength, 0.5 * kLength),
                   {0, radians(degrees), 0}});
  return all;
}

void measure_limb(const Limb& limb, double solidity) {
  const std::vector<int> roles = dd::test::ends_held(limb.mesh, 0.1, 0.9);
  std::vector<char> free;
  for (int role : roles) free.push_back(role == dd::kFree);
  dd::Deformer deformer(limb.mesh, roles, 1, {});
  dd::UpdateOptions options;
  options.of_method.refined.iterations = 4;
  options.of_method.refined.rim_smoothing = 0.05;
  options.of_method.refined.solidity = solidity;
  const double first =
      milliseconds([&] { deformer.update(motions().front().matrix.data(), options); });
  std::printf("%s, %d vertices, solidity %g: first update %.1f ms\n", limb.name.c_str(),
              limb.mesh.vertex_count(), solidity, first);
  for (const Motion& motion : motions()) {
    options.turns.assign(motion.turn.data(), motion.turn.data() + 3);
    std::vector<double> times;
    Positions p;
    for (int round = 0; round < 5; ++round)
      times.push_back(milliseconds(
          [&] { p = limb.mesh.positions + deformer.update(motion.matrix.data(), options); }));
    const dd::Measures found = dd::measure(limb.mesh, p, free);
    std::printf("  %-13s section %.3f  volume %.3f  stretch %.3f  intersecting %5d  %8.2f ms\n",
                motion.name.c_str(), limb.least_section(p), found.volume_ratio, found.stretch,
                found.intersecting_triangles, dd::bench::median(times));
  }
}

}  // namespace

int main(int argc, char** argv) {
  const int density = argc > 1 ? std::atoi(argv[1]) : 1;
  if (density < 1) return std::fprintf(stderr, "limbs [density]\n"), 2;
  const Limb limbs[] = {{"tentacle", density, 0.5, 0.06, 1, 0},
                        {"cylinder", density, 0.3, 0.3, 1, 0},
                        {"flat limb", density, 0.5, 0.3, 0.5, 0},
                        {"relief", density, 0.4, 0.2, 1, 0.08}};
  for (const Limb& limb : limbs)
    for (const double solidity : {0.0, 1.0}) measure_limb(limb, solidity);
}
