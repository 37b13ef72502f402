// SPDX-License-Identifier: GPL-3.0-or-later
// The cost of many handles: binds and frames of the bumpy plane of Fig. 1, fixed at its left side
// and moved by handles of one vertex all over it. A case of few and one of many take turns.
//
//   handles [--side 159] [--few 10] [--many 271] [--rounds 9]
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <random>
#include <vector>

#include "deform/deformer.h"
#include "machine.h"
#include "meshes.h"
#include "support/rotations.h"
#include "timing.h"

namespace {

using dd::bench::median;
using dd::bench::milliseconds;

/// Handles of single vertices, spread evenly over the plane's free part.
struct Case {
  Case(const dd::Mesh& its_mesh, int side, int its_count) : mesh(its_mesh), count(its_count) {
    roles.assign(static_cast<size_t>(side) * static_cast<size_t>(side), dd::kFree);
    for (int v = 0; v < 5 * side; ++v) roles[v] = dd::kFixed;
    // Roberts' low-discrepancy sequence R2: any number of its points is spread evenly.
    const double golden = 1.32471795724474602596;
    for (int h = 0; h < count; ++h) {
      const double x = std::fmod(0.5 + (h + 1) / golden, 1.0);
      const double y = std::fmod(0.5 + (h + 1) / (golden * golden), 1.0);
      const int i = 8 + static_cast<int>(x * (side - 8)), j = static_cast<int>(y * side);
      roles[size_t(std::min(i, side - 1)) * size_t(side) + size_t(j)] = h;
    }
  }

  void bind() {
    deformer.reset();
    dd::BindOptions options;
    options.precision = dd::Precision::single;
    options.threads = 1;
    deformer = std::make_unique<dd::Deformer>(mesh, roles, count, options);
  }

  /// Random moves along z of at most `step`, and turns about x of at most so many degrees.
  std::vector<double> pose(double step, double degrees) const {
    std::mt19937 random(7);
    std::uniform_real_distribution<double> way(-1, 1);
    std::vector<double> matrices;
    const dd::Positions& p = mesh.positions;
    std::vector<int> vertex(static_cast<size_t>(count));
    for (size_t v = 0; v < roles.size(); ++v)
      if (roles[v] >= 0) vertex[size_t(roles[v])] = static_cast<int>(v);
    for (int h = 0; h < count; ++h) {
      const Eigen::Vector3d centre = p.row(vertex[size_t(h)]);
      const dd::test::Affine matrix =
          dd::test::rotation_about(degrees * way(random) * dd::kPi / 180, Eigen::Vector3d::UnitX(),
                                   centre, step * way(random) * Eigen::Vector3d::UnitZ());
      matrices.insert(matrices.end(), matrix.data(), matrix.data() + 12);
    }
    return matrices;
  }

  double update(const std::vector<double>& matrices, const dd::UpdateOptions& options) {
    out.resize(3 * roles.size());
    return milliseconds(
        [&] { deformer->update_to(out.data(), 3, false, matrices.data(), options); });
  }

  const dd::Mesh& mesh;
  int count;
  std::vector<int> roles;
  std::unique_ptr<dd::Deformer> deformer;
  std::vector<float> out;
};

dd::UpdateOptions refined(int iterations, bool free, int count) {
  dd::UpdateOptions options;
  options.of_method.refined.iterations = iterations;
  options.of_method.refined.rim_smoothing = iterations > 0 ? 0.05 : 0;  // the default, or (14)
  if (free) options.free.assign(static_cast<size_t>(count), 1);
  return options;
}

}  // namespace

int main(int argc, char** argv) {
  int side = 159, few = 10, many = 271, rounds = 9;
  for (int i = 1; i + 1 < argc; i += 2) {
    if (!std::strcmp(argv[i], "--side")) side = std::atoi(argv[i + 1]);
    if (!std::strcmp(argv[i], "--few")) few = std::atoi(argv[i + 1]);
    if (!std::strcmp(argv[i], "--many")) many = std::atoi(argv[i + 1]);
    if (!std::strcmp(argv[i], "--rounds")) rounds = std::atoi(argv[i + 1]);
  }
  if (side < 20 || few < 1 || many < 1 || rounds < 1)
    return std::fprintf(stderr,
                        "handles [--side N, 20 at least] [--few N] [--many N] [--rounds N]\n"),
           2;
  const dd::Mesh mesh = dd::test::bumpy_plane(side);
  Case cases[] = {{mesh, side, few}, {mesh, side, many}};
  std::printf("%s\n%d triangles, one thread\n%-44s %9d %9d handles\n", dd::bench::machine().c_str(),
              mesh.triangle_count(), "", few, many);
  const auto print = [&](const char* name, const std::vector<double>(&times)[2]) {
    std::printf("  %-42s %9.2f %9.2f ms %8.2f x\n", name, median(times[0]), median(times[1]),
                median(times[1]) / median(times[0]));
  };
  std::vector<double> times[2];
  for (int round = -1; round < std::max(3, rounds / 3); ++round)
    for (int k = 0; k < 2; ++k) {
      const double ms = milliseconds([&] { cases[k].bind(); });
      if (round >= 0) times[k].push_back(ms);
    }
  print("bind", times);
  const struct {
    const char* name;
    int iterations;
    bool free;
    double degrees;
  } looks[] = {{"move", 0, false, 20},
               {"  with 4 refinements", 4, false, 20},
               {"  where some turn by half a turn", 4, false, 180},
               {"  where they only place", 4, true, 0}};
  for (const auto& look : looks) {
    double first[2] = {0, 0};
    for (std::vector<double>& each : times) each.clear();
    for (int round = 0; round <= rounds; ++round)
      for (int k = 0; k < 2; ++k) {
        Case& it = cases[k];
        const double ms = it.update(it.pose(0.03 * (1 + 0.01 * round), look.degrees),
                                    refined(look.iterations, look.free, it.count));
        if (round == 0)
          first[k] = ms;
        else
          times[k].push_back(ms);
      }
    print(look.name, times);
    std::printf("  %-42s %9.2f %9.2f ms\n", "    the first such", first[0], first[1]);
  }
  std::printf("  %-42s %9.1f %9.1f MB\n", "held", cases[0].deformer->bytes() / 1e6,
              cases[1].deformer->bytes() / 1e6);
  return 0;
}
