// SPDX-License-Identifier: GPL-3.0-or-later
#include "methods/examples/example_logarithms.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <queue>
#include <tuple>

#include "mesh/topology.h"
#include "mesh/unit_box.h"
#include "reconstruction/gradients.h"
#include "support/rotations.h"

namespace dd {

namespace {

// Radians. A smaller swing beside a twist beyond 180° is put down to shear and dropped; a larger
// one belongs to the rotation.
constexpr double kMaxDroppedSwing = 0.5;

/// The chosen triangles, and which of them surround each vertex.
struct ActivePatch {
  ActivePatch(const Triangles& t, std::vector<int> chosen, const Region& region)
      : triangles(std::move(chosen)),
        corners(rows_of(t, triangles)),
        fans(corners, static_cast<int>(region.role.size())) {
    for (size_t i = 0; i < triangles.size(); ++i) {
      bool touches = false;
      for (int k = 0; k < 3; ++k) touches |= region.role[t(triangles[i], k)] == kFixed;
      touches_fixed.push_back(touches);
    }
  }
  static Triangles rows_of(const Triangles& t, const std::vector<int>& chosen) {
    Triangles rows(static_cast<Index>(chosen.size()), 3);
    for (size_t i = 0; i < chosen.size(); ++i) rows.row(Index(i)) = t.row(chosen[i]);
    return rows;
  }
  std::vector<int> triangles;
  Triangles corners;
  VertexTriangles fans;
  std::vector<char> touches_fixed;  // whether a triangle has a fixed corner
};

/// The rotation vector of this rotation that is continuous with the neighbour's.
Eigen::Vector3d continued(const Eigen::Quaterniond& rotation, const Eigen::Vector3d& neighbour) {
  const double length = neighbour.norm();
  if (length > kPi) {
    const Eigen::Vector3d axis = neighbour / length;
    const double along = rotation.vec().dot(axis), w = rotation.w();
    const double twist = 2 * std::atan2(along, w);
    const double swing = 2 * std::acos(std::min(1.0, std::sqrt(along * along + w * w)));
    if (swing < kMaxDroppedSwing)
      return (twist + 2 * kPi * std::round((length - twist) / (2 * kPi))) * axis;
  }
  return rotation_vector_near(Eigen::AngleAxisd(rotation), neighbour);
}

Positions continuous_logarithms(const Rows& rotations, const ActivePatch& active_patch) {
  const int count = static_cast<int>(active_patch.triangles.size());
  Positions logarithms(count, 3);
  std::vector<char> done(static_cast<size_t>(count), 0);
  // Priority (1 − |cos| of half the angle between the rotations, + 2 across a single vertex),
  // triangle, neighbour that it continues from.
  using Step = std::tuple<double, int, int>;
  std::priority_queue<Step, std::vector<Step>, std::greater<Step>> queue;
  const auto set_logarithm = [&](int i, const Eigen::Vector3d& logarithm) {
    logarithms.row(i) = logarithm.transpose();
    done[i] = 1;
    const auto corners = active_patch.corners.row(i);
    for (int k = 0; k < 3; ++k)
      for (int other : active_patch.fans.of(corners[k])) {
        if (done[other]) continue;
        int shared = 0;
        for (int c = 0; c < 3; ++c)
          shared += (corners.array() == active_patch.corners(other, c)).any();
        const double dissimilarity = 1 - std::abs(rotations.row(i).dot(rotations.row(other)));
        queue.emplace(shared > 1 ? dissimilarity : dissimilarity + 2, other, i);
      }
  };

  std::vector<int> starts(static_cast<size_t>(count));
  std::iota(starts.begin(), starts.end(), 0);
  std::sort(starts.begin(), starts.end(), [&](int a, int b) {
    return std::make_tuple(!active_patch.touches_fixed[a], -rotations(a, 3), a) <
           std::make_tuple(!active_patch.touches_fixed[b], -rotations(b, 3), b);
  });
  for (int start : starts) {
    if (done[start]) continue;
    const Eigen::AngleAxisd shortest(quaternion(rotations, start));
    set_logarithm(start, shortest.angle() * shortest.axis());
    while (!queue.empty()) {
      const auto [dissimilarity, i, from] = queue.top();
      queue.pop();
      if (!done[i])
        set_logarithm(i, continued(quaternion(rotations, i), logarithms.row(from).transpose()));
    }
  }
  return logarithms;
}

}  // namespace

ExampleLogarithms::ExampleLogarithms(const FactoredSurface& surface,
                                     const std::vector<Positions>& examples)
    : row_of_triangle_(static_cast<size_t>(surface.mesh.triangle_count()), -1) {
  const Triangles& t = surface.operators.triangles;
  const Positions& rest = surface.mesh.positions;
  std::vector<int> chosen;
  for (int j = 0; j < surface.mesh.triangle_count(); ++j)
    for (int k = 0; k < 3; ++k)
      if (row_of_triangle_[j] < 0 && surface.region.role[t(j, k)] != kFixed) {
        row_of_triangle_[j] = static_cast<int>(chosen.size());
        chosen.push_back(j);
      }
  const ActivePatch active_patch(t, std::move(chosen), surface.region);
  const double size = bounding_box_diagonal(rest);

  logarithms_.resize(examples.size());
  surface.poisson->pool().run(static_cast<int>(logarithms_.size()), [&](int i) {
    const Positions& example = examples[i];
    const auto blocks = rotation_blocks<double>(
        rest, t, active_patch.triangles, stand_ins(rest, t, size, &example), surface.order());
    Rows rotations(kLanes * static_cast<Index>(blocks.size()), 4);
    kernels().full.rotation_pass(static_cast<int>(blocks.size()), blocks.data(),
                                 in_order(example, surface.order()).data(), rotations.data());
    logarithms_[i] = continuous_logarithms(rotations, active_patch);
  });
}

double ExampleLogarithms::bytes() const {
  double bytes = static_cast<double>(row_of_triangle_.size() * sizeof(int));
  for (const Positions& logarithms : logarithms_)
    bytes += static_cast<double>(logarithms.size() * Index(sizeof(double)));
  return bytes;
}

}  // namespace dd
