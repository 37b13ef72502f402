// SPDX-License-Identifier: GPL-3.0-or-later
// Posing by example: times of an update of a limb of 10,000 vertices whose tip is led along an arc,
// for several numbers of examples, which are bends at places along it; the handle's motion hardly
// tells which. Beside detail transfer. With files of a mesh and its poses: each pose is left out,
// and found from a few handles at its places and the others as examples, by both methods again.
//
//   posing [--threads 2] [--handles 6] [REST.obj POSE.obj...]
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "cases.h"
#include "deform/deformer.h"
#include "mesh/geodesic_distances.h"
#include "mesh/unit_box.h"
#include "mesh_files.h"
#include "support/similarity.h"
#include "timing.h"

namespace {

/// The z axis bent from height joint on, over a length of 0.2.
dd::Positions bent(const dd::Positions& p, double degrees, double joint) {
  dd::Positions moved = p;
  moved.col(2).array() -= joint + 0.1;
  dd::Positions result =
      dd::test::bent_explicitly(moved, degrees, 0.2 / dd::test::radians(degrees));
  // Moved so that the lower end is in its place again.
  const double half = dd::test::radians(degrees) / 2, radius = 0.1 / half;
  const dd::test::Affine back = dd::test::rotation_about(half, {0, 1, 0}, {0, 0, 0}, {0, 0, 0});
  const Eigen::Vector3d hinge(radius - radius * std::cos(half), 0, -radius * std::sin(half));
  result = dd::test::transformed(back, result);
  const Eigen::Vector3d there = back.leftCols<3>() * hinge;
  return result.rowwise() - (there - Eigen::Vector3d(0, 0, joint)).transpose();
}

}  // namespace

namespace {

using dd::bench::median;
using dd::bench::milliseconds;

dd::UpdateOptions options_by(dd::MethodKind method) {
  dd::UpdateOptions options;
  options.method = method;
  options.of_method.rotation_only = method != dd::MethodKind::examples;
  options.of_method.refined.iterations = 4;
  options.of_method.refined.rim_smoothing = 0.05;
  return options;
}

/// Handles for discs that are as far from each other over the surface as can be; nothing is fixed.
std::vector<int> far_handles(const dd::Mesh& mesh, int count) {
  const auto n = static_cast<size_t>(mesh.vertex_count());
  const auto distances = [&](int from) {
    std::vector<char> source(n, 0);
    source[size_t(from)] = 1;
    return dd::geodesic_distances(mesh, source);
  };
  const auto farthest = [&](const std::vector<double>& distance) {
    size_t best = 0;
    for (size_t v = 0; v < n; ++v)
      if (std::isfinite(distance[v]) && !(distance[v] <= distance[best])) best = v;
    return static_cast<int>(best);
  };
  const double radius = 0.04 * dd::bounding_box_diagonal(mesh.positions);
  std::vector<int> roles(n, dd::kFree);
  std::vector<double> nearest(n, std::numeric_limits<double>::infinity());
  for (int h = 0, at = farthest(distances(0)); h < count; ++h, at = farthest(nearest)) {
    const std::vector<double> own = distances(at);
    for (size_t v = 0; v < n; ++v) {
      if (own[v] < radius && roles[v] == dd::kFree) roles[v] = h;
      nearest[v] = std::min(nearest[v], own[v]);
    }
  }
  return roles;
}

/// For each handle the rigid motion nearest to its vertices' motion.
std::vector<double> motions_to(const dd::Mesh& mesh, const dd::Positions& pose,
                               const std::vector<int>& roles, int count) {
  std::vector<double> matrices;
  for (int h = 0; h < count; ++h) {
    Eigen::VectorXd weights = Eigen::VectorXd::Zero(mesh.vertex_count());
    for (dd::Index v = 0; v < weights.size(); ++v) weights[v] = roles[size_t(v)] == h;
    const dd::Similarity motion = dd::fitted_similarity(mesh.positions, pose, weights);
    const Eigen::Vector3d from = weights.transpose() * mesh.positions / weights.sum();
    const Eigen::Vector3d to = weights.transpose() * pose / weights.sum();
    const Eigen::Vector3d shift = to - motion.rotation * from;
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) matrices.push_back(motion.rotation(r, c));
      matrices.push_back(shift[r]);
    }
  }
  return matrices;
}

/// The largest step of any vertex over that of the handles, on a way through stops of their
/// matrices.
double largest_leap(dd::Deformer& deformer, const std::vector<std::vector<double>>& stops,
                    const dd::UpdateOptions& options) {
  double leap = 0, step = 0;
  dd::Positions last;
  for (size_t stop = 1; stop < stops.size(); ++stop)
    for (int k = 0; k < 50; ++k) {
      std::vector<double> matrices = stops[stop];
      for (size_t i = 0; i < matrices.size(); ++i)
        matrices[i] = stops[stop - 1][i] + 0.02 * k * (matrices[i] - stops[stop - 1][i]);
      const dd::Positions now = deformer.update(matrices.data(), options);
      if (last.size() > 0) {
        const Eigen::VectorXd moved = (now - last).rowwise().norm();
        leap = std::max(leap, moved.maxCoeff());
        const std::vector<int>& roles = deformer.region().role;
        for (dd::Index v = 0; v < moved.size(); ++v)
          if (roles[size_t(v)] >= 0) step = std::max(step, moved[v]);
      }
      last = now;
    }
  return leap / step;
}

void left_out(const std::vector<std::string>& files, int count, int threads) {
  const dd::Mesh mesh = dd::bench::mesh_from_file(files[0]);
  std::vector<dd::Positions> poses;
  for (size_t i = 1; i < files.size(); ++i)
    poses.push_back(dd::bench::mesh_from_file(files[i]).positions);
  const std::vector<int> roles = far_handles(mesh, count);
  const double size = dd::bounding_box_diagonal(mesh.positions);
  std::vector<double> errors[2], times[2];
  double leap = 0;
  for (size_t left = 0; left < poses.size(); ++left) {
    dd::BindOptions bind;
    bind.precision = dd::Precision::single;
    bind.threads = threads;
    for (size_t i = 0; i < poses.size(); ++i)
      if (i != left) bind.examples.push_back(poses[i]);
    dd::Deformer deformer(mesh, roles, count, bind);
    const std::vector<double> matrices = motions_to(mesh, poses[left], roles, count);
    for (const bool by_examples : {true, false}) {
      const dd::UpdateOptions options =
          options_by(by_examples ? dd::MethodKind::examples : dd::MethodKind::detail);
      const dd::Positions found = mesh.positions + deformer.update(matrices.data(), options);
      errors[by_examples].push_back(100 * (found - poses[left]).rowwise().norm().mean() / size);
      for (int round = 0; round < 20; ++round)
        times[by_examples].push_back(
            milliseconds([&] { deformer.update(matrices.data(), options); }));
    }
    if (left > 0 || poses.size() < 4) continue;
    const dd::Positions between = 0.5 * (poses[0] + poses[3]);
    leap = largest_leap(deformer,
                        {motions_to(mesh, mesh.positions, roles, count), matrices,
                         motions_to(mesh, between, roles, count)},
                        options_by(dd::MethodKind::examples));
  }
  const auto mean = [](const std::vector<double>& values) {
    double sum = 0;
    for (double value : values) sum += value;
    return sum / static_cast<double>(values.size());
  };
  std::printf(
      "%d vertices, %zu poses, %d handles: mean error of those left out, %% of the box, by "
      "examples "
      "%.2f, by transfer %.2f; an update %.2f and %.2f ms, %.1f x; largest leap %.1f steps\n",
      mesh.vertex_count(), poses.size(), count, mean(errors[1]), mean(errors[0]), median(times[1]),
      median(times[0]), median(times[1]) / median(times[0]), leap);
}

void along_an_arc(int threads) {
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
    const auto update = [&](double degrees, dd::MethodKind method) {
      const dd::test::Affine motion = dd::test::bend(degrees, 0.2, 0.6);
      return milliseconds([&] { deformer.update(motion.data(), options_by(method)); });
    };
    const double preparing = update(0, dd::MethodKind::examples);
    update(0, dd::MethodKind::detail);
    std::vector<double> times, of_transfer;
    for (int step = 1; step <= 24; ++step) {
      times.push_back(update(5 * step, dd::MethodKind::examples));
      of_transfer.push_back(update(5 * step, dd::MethodKind::detail));
    }
    std::sort(times.begin(), times.end());
    std::printf("  %2d examples  %7.1f  %7.2f %7.2f, detail transfer %.2f\n", count, preparing,
                times[12], times.back(), median(of_transfer));
  }
}

}  // namespace

int main(int argc, char** argv) {
  int threads = 2, handles = 6;
  std::vector<std::string> files;
  for (int i = 1; i < argc; ++i) {
    if (!std::strcmp(argv[i], "--threads") && i + 1 < argc)
      threads = std::atoi(argv[++i]);
    else if (!std::strcmp(argv[i], "--handles") && i + 1 < argc)
      handles = std::atoi(argv[++i]);
    else
      files.emplace_back(argv[i]);
  }
  if (files.empty())
    along_an_arc(threads);
  else
    left_out(files, handles, threads);
  return 0;
}
