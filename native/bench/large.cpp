// SPDX-License-Identifier: GPL-3.0-or-later
// What FactoredSurface::large saves and costs: surfaces bound by MixedBilaplacian and CoarseClamps,
// and the same by factors of K and of L + L W L.
//
//     large [SIDE | FILE [SUBDIVISIONS]]...
//
// SIDE: of the bumpy plane of Fig. 1 with its right side lifted and turned. FILE: .off or .obj, its
// triangles split so many times at midpoints; the last 15% along y are pulled out by 12% of the box
// and turned by 40°, the first 35% are fixed. By two threads, single precision, the defaults with
// Solidity 0. One process a surface tells its memory.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include "cases.h"
#include "deform.h"
#include "machine.h"
#include "mesh_files.h"
#include "pulled_end.h"
#include "timing.h"

namespace {

using dd::bench::milliseconds;

dd::test::Case plane(int side) {
  dd::test::Case one;
  one.mesh = dd::test::bumpy_plane(side);
  one.roles = dd::test::strip_roles(side, side, side * 23 / 201, side * 178 / 201);
  one.motion = dd::test::rotation_about(dd::test::radians(37), {1, 0, 0}, {0, 0, 0}, {0, 0, 0.5});
  return one;
}

dd::test::Case pulled(const char* path, int subdivisions) {
  dd::test::Case one;
  one.mesh = dd::bench::mesh_from_file(path);
  one.roles.assign(size_t(one.mesh.vertex_count()), dd::kFree);
  for (int k = 0; k < subdivisions; ++k) one = dd::test::subdivided(std::move(one));
  dd::bench::PulledEnd end = dd::bench::pulled_end(one.mesh, 1, true, 0.35);
  one.roles = std::move(end.roles);
  one.motion = end.motion;
  return one;
}

struct Measured {
  double bind = 0, first = 0, update = 0, bytes = 0;
  dd::Positions result;
  int free_count = 0;
};

Measured measure(const dd::test::Case& one, bool large) {
  dd::BindOptions options;
  options.precision = dd::Precision::single;
  options.threads = 2;
  options.large_from = large ? 0 : std::numeric_limits<int>::max();
  Measured found;
  std::unique_ptr<dd::Deformer> deformer;
  found.bind = milliseconds(
      [&] { deformer = std::make_unique<dd::Deformer>(one.mesh, one.roles, 1, options); });
  const dd::UpdateOptions how = dd::test::usual();
  found.first =
      milliseconds([&] { found.result = dd::test::surface(*deformer, {one.motion}, how); });
  std::vector<float> out(3 * size_t(one.mesh.vertex_count()));
  std::vector<double> times;
  for (int round = 0; round < 9; ++round)
    times.push_back(
        milliseconds([&] { deformer->update_to(out.data(), 3, true, one.motion.data(), how); }));
  found.update = dd::bench::median(times);
  found.bytes = deformer->bytes();
  found.free_count = deformer->region().free_count();
  return found;
}

void compare(const char* name, const dd::test::Case& one) {
  const Measured by_factors = measure(one, false), large = measure(one, true);
  Eigen::VectorXd apart = (large.result - by_factors.result).rowwise().norm() /
                          dd::bounding_box_diagonal(one.mesh.positions);
  const double mean = std::sqrt(apart.squaredNorm() / by_factors.free_count);
  std::sort(apart.begin(), apart.end());
  std::printf("%s: %d vertices, %d free\n", name, one.mesh.vertex_count(), by_factors.free_count);
  const auto row = [](const char* what, const Measured& m) {
    std::printf("  %-10s bind %7.0f ms, first update %6.0f, update %6.1f, held %5.0f MB\n", what,
                m.bind, m.first, m.update, 1e-6 * m.bytes);
  };
  row("by factors", by_factors);
  row("large", large);
  std::printf("  apart, of the box: at most %.1e, at 99%% of the free vertices %.1e, rms %.1e\n",
              apart[apart.size() - 1], apart[apart.size() - 1 - by_factors.free_count / 100], mean);
}

}  // namespace

int main(int count, char** arguments) {
  std::printf("%s\n", dd::bench::machine().c_str());
  for (int i = 1; i < count; ++i) {
    const int side = std::atoi(arguments[i]);
    if (side > 0) {
      compare("plane", plane(side));
      continue;
    }
    const int subdivisions = i + 1 < count ? std::atoi(arguments[i + 1]) : 0;
    const bool given = subdivisions > 0 && subdivisions < 10;
    compare(arguments[i], pulled(arguments[i], given ? subdivisions : 0));
    i += given;
  }
  return 0;
}
