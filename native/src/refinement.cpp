// SPDX-License-Identifier: GPL-3.0-or-later
#include "refinement.h"

#include <algorithm>

#include "gradients.h"

namespace dd {

Refinement::Refinement(BoundSurface& bound) : bound_(bound) {
  const Triangles& t = bound.mesh.triangles;
  const RowOrder& order = bound.order();
  const std::vector<int>& active = bound.poisson.active_triangles();
  const int m = bound.mesh.triangle_count();

  // Vertices of triangles with a free corner, and the other triangles of these vertices.
  std::vector<int> local_vertex(bound.region.role.size(), -1), vertices;
  std::vector<int> local_triangle(static_cast<size_t>(m), -1), rim;
  for (size_t i = 0; i < active.size(); ++i) {
    local_triangle[active[i]] = static_cast<int>(i);
    for (int k = 0; k < 3; ++k) {
      int& number = local_vertex[t(active[i], k)];
      if (number >= 0) continue;
      number = static_cast<int>(vertices.size());
      vertices.push_back(t(active[i], k));
    }
  }
  const GradientSources sources =
      gradient_sources(bound.mesh.positions, t, bounding_box_diagonal(bound.mesh.positions));
  moving_ = rotation_blocks(bound.mesh.positions, t, active, sources, order);
  const int first_rim = kLanes * static_cast<int>(moving_.size());
  for (int j = 0; j < m; ++j) {
    if (local_triangle[j] >= 0) continue;
    for (int k = 0; k < 3; ++k) {
      if (local_vertex[t(j, k)] < 0) continue;
      local_triangle[j] = first_rim + static_cast<int>(rim.size());
      rim.push_back(j);
      break;
    }
  }
  if (!rim.empty()) held_ = rotation_blocks(bound.mesh.positions, t, rim, sources, order);

  std::vector<std::vector<int>> fan(vertices.size());
  for (int j = 0; j < m; ++j)
    for (int k = 0; k < 3 && local_triangle[j] >= 0; ++k)
      if (local_vertex[t(j, k)] >= 0) fan[local_vertex[t(j, k)]].push_back(j);
  for (const std::vector<int>& triangles : fan) {
    double sum = 0;
    for (int j : triangles) sum += bound.operators.metric.areas[j];
    for (int j : triangles) {
      of_vertices_.index.push_back(local_triangle[j]);
      of_vertices_.weights.push_back(bound.operators.metric.areas[j] / sum);
    }
    of_vertices_.starts.push_back(static_cast<int>(of_vertices_.index.size()));
  }
  for (int j : active) {
    for (int k = 0; k < 3; ++k) {
      of_triangles_.index.push_back(local_vertex[t(j, k)]);
      of_triangles_.weights.push_back(1.0 / 3);
    }
    of_triangles_.starts.push_back(static_cast<int>(of_triangles_.index.size()));
  }

  const Positions flux = corner_divergence(bound.operators.metric, bound.mesh.positions, t);
  turns_.resize(moving_.size());
  for (size_t i = 0; i < turns_.size() * kLanes; ++i) {
    TurnBlock& block = turns_[i / kLanes];
    const size_t lane = i % kLanes;
    for (int k = 0; k < 3; ++k)
      block.target[k][lane] =
          i < active.size() ? order.target_of_vertex(t(active[i], k)) : order.free_count;
    for (int k = 0; k < 2; ++k)
      for (int c = 0; c < 3; ++c)
        block.flux[k][c][lane] = i < active.size() ? flux(3 * Index(active[i]) + k, c) : 0;
  }
  positions_ = bound.rest;
  triangle_rotations_ = Rows::Zero(first_rim + kLanes * Index(held_.size()), 4);
  vertex_rotations_ = Rows::Zero(static_cast<Index>(vertices.size()), 4);
}

void Refinement::Averages::apply(const Rows& in, Rows& out) const {
  kernels().mean_rotations(count(), starts.data(), index.data(), weights.data(), in.data(),
                           out.data());
}

double Refinement::Averages::bytes() const {
  return static_cast<double>((starts.size() + index.size()) * sizeof(int) +
                             weights.size() * sizeof(double));
}

void Refinement::run(int iterations, Rows& offsets) {
  const int moving = static_cast<int>(moving_.size());
  for (int iteration = 0; iteration < iterations; ++iteration) {
    positions_ = bound_.rest + offsets;
    kernels().rotation_pass(moving, moving_.data(), positions_.data(), triangle_rotations_.data());
    if (iteration == 0)
      kernels().rotation_pass(static_cast<int>(held_.size()), held_.data(), positions_.data(),
                              triangle_rotations_.data() + 4 * kLanes * Index(moving));
    for (int pass = 0; pass < kPasses; ++pass) {
      of_vertices_.apply(triangle_rotations_, vertex_rotations_);
      of_triangles_.apply(vertex_rotations_, triangle_rotations_);
    }
    double* rows = bound_.poisson.start(offsets);
    kernels().turn_pass(moving, turns_.data(), triangle_rotations_.data(), rows);
    bound_.poisson.solve(offsets);
  }
}

double Refinement::bytes() const {
  const auto rows = positions_.size() + triangle_rotations_.size() + vertex_rotations_.size();
  return static_cast<double>((moving_.size() + held_.size()) * sizeof(RotationBlock) +
                             turns_.size() * sizeof(TurnBlock)) +
         of_vertices_.bytes() + of_triangles_.bytes() +
         static_cast<double>(rows * Index(sizeof(double)));
}

}  // namespace dd
