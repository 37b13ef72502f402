// SPDX-License-Identifier: GPL-3.0-or-later
// What an update by examples costs on a limb of 10,000 vertices whose tip is led along an arc, for
// several numbers of examples: bends at places along it, the handle saying little about which.
//
//   posing [--threads 2]
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "cases.h"
#include "deform/deformer.h"
#include "timing.h"

namespace {

/// The z axis bent from height joint on, over a length of 0.2.
dd::Positions bent(const dd::Positions& p, double degrees, double joint) {
  dd::Positions moved = p;
  moved.col(2).array() -= joint + 0.1;
  dd::Positions result =
      dd::test::bent_explicitly(moved, degrees, 0.2 / dd::test::radians(degrees));
  // Back to where the lower end was.
  const double half = dd::test::radians(degrees) / 2, radius = 0.1 / half;
  const dd::test::Affine back = dd::test::rotation_about(half, {0, 1, 0}, {0, 0, 0}, {0, 0, 0});
  const Eigen::Vector3d hinge(radius - radius * std::cos(half), 0, -radius * std::sin(half));
  result = dd::test::transformed(back, result);
  const Eigen::Vector3d there = back.leftCols<3>() * hinge;
  return result.rowwise() - (there - Eigen::Vector3d(0, 0, joint)).transpose();
}

}  // namespace

int main(int argc, char** argv) {
  const int threads = argc > 2 ? std::atoi(argv[2]) : 2;
  const dd::Mesh mesh = dd::test::tube(101, 99, [](double u, double v) {
    return Eigen::RowVector3d(0.08 * std::cos(v), 0.08 * std::sin(v), 1.6 * u);
  });
  const std::vector<int> roles = dd::test::ends_held(mesh, 0.1, 0.95);
  std::printf("%d vertices, %d threads: preparing, then an update, median and slowest of 24, ms\n",
              mesh.vertex_count(), threads);
  for (int count : {1, 3, 10, 20}) {
    dd::BindOptions bind;
    bind.precision = dd::Precision::single;
    bind.threads = threads;
    for (int i = 0; i < count; ++i)
      bind.examples.push_back(
          bent(mesh.positions, 40 + 60.0 * (i % 3), 0.2 + 1.0 * i / std::max(1, count - 1)));
    dd::Deformer deformer(mesh, roles, 1, bind);
    dd::UpdateOptions options;
    options.method = dd::MethodKind::examples;
    options.of_method.rotation_only = false;
    const auto update = [&](double degrees) {
      const dd::test::Affine motion = dd::test::bend(degrees, 0.2, 0.6);
      return dd::bench::milliseconds([&] { deformer.update(motion.data(), options); });
    };
    const double preparing = update(0);
    std::vector<double> times;
    for (int step = 1; step <= 24; ++step) times.push_back(update(5 * step));
    std::sort(times.begin(), times.end());
    std::printf("  %2d examples  %7.1f  %7.2f %7.2f\n", count, preparing, times[12], times.back());
  }
  return 0;
}
