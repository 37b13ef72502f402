// SPDX-License-Identifier: GPL-3.0-or-later
#include "gradients.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>

namespace dd {

namespace {

constexpr double kShortest = 1e-9;  // of the surface's size
constexpr double kFlattest = 1e-6;  // height over longest edge

bool has_area(const Positions& p, const Triangles& t, Index j, double shortest) {
  const Eigen::Vector3d a = p.row(t(j, 0)), b = p.row(t(j, 1)), c = p.row(t(j, 2));
  const double longest = std::max({(b - a).norm(), (c - b).norm(), (a - c).norm()});
  return longest > shortest && (b - a).cross(c - a).norm() > kFlattest * longest * longest;
}

/// Directed half-edges sorted by their undirected edge, so that triangles of one edge are together.
std::vector<std::array<int, 3>> edges_with_triangles(const Triangles& t) {
  std::vector<std::array<int, 3>> edges;
  edges.reserve(static_cast<size_t>(t.size()));
  for (Index j = 0; j < t.rows(); ++j) {
    for (int k = 0; k < 3; ++k) {
      const auto [low, high] = std::minmax(t(j, k), t(j, (k + 1) % 3));
      edges.push_back({low, high, static_cast<int>(j)});
    }
  }
  std::sort(edges.begin(), edges.end());
  return edges;
}

}  // namespace

GradientSources gradient_sources(const Positions& base, const Triangles& t, double size) {
  const double shortest = kShortest * size;
  const int m = static_cast<int>(t.rows());
  GradientSources sources;
  sources.of_triangle.assign(static_cast<size_t>(m), -1);
  for (int j = 0; j < m; ++j) {
    if (has_area(base, t, j, shortest))
      sources.of_triangle[j] = j;
    else
      ++sources.borrowed_count;
  }
  if (sources.borrowed_count == 0) return sources;

  // Waves from the sound triangles into the others. Each wave reads the state before it, and edges
  // are visited in order, so the result does not depend on anything but the mesh.
  const auto edges = edges_with_triangles(t);
  for (bool spread = true; spread;) {
    spread = false;
    const std::vector<int> before = sources.of_triangle;
    for (size_t i = 0; i < edges.size();) {
      size_t end = i;
      int found = -1;
      for (; end < edges.size() && edges[end][0] == edges[i][0] && edges[end][1] == edges[i][1];
           ++end)
        if (found < 0) found = before[edges[end][2]];
      for (; i < end; ++i) {
        int& source = sources.of_triangle[edges[i][2]];
        if (found >= 0 && source < 0) {
          source = found;
          spread = true;
        }
      }
    }
  }
  return sources;
}

GradientPass::GradientPass(const Positions& base, const Triangles& t, const Positions& corner_flux,
                           const std::vector<int>& active, const GradientSources& sources,
                           const std::vector<int>& source_row, const std::vector<int>& target_row,
                           int spare_row) {
  blocks_.resize((active.size() + kLanes - 1) / kLanes);
  for (size_t b = 0; b < blocks_.size(); ++b) {
    TriangleBlock& block = blocks_[b];
    block = {};
    for (int lane = 0; lane < kLanes; ++lane) {
      for (int k = 0; k < 3; ++k) block.target[k][lane] = spare_row;
      const size_t i = b * kLanes + static_cast<size_t>(lane);
      if (i >= active.size()) continue;
      const int j = active[i], source = sources.of_triangle[j];
      if (source < 0) continue;

      const auto corner = t.row(source);
      const Eigen::Vector3d p0 = base.row(corner[0]);
      const Eigen::Vector3d e1 = base.row(corner[1]).transpose() - p0;
      const Eigen::Vector3d e2 = base.row(corner[2]).transpose() - p0;
      const Eigen::Vector3d cross = e1.cross(e2);
      const double length = e1.norm(), double_area = cross.norm();
      block.inverse_length[lane] = 1 / length;
      block.shear[lane] = e1.dot(e2) / (length * double_area);
      block.inverse_height[lane] = length / double_area;
      Eigen::Matrix3d frame;
      frame.col(0) = e1 / length;
      frame.col(2) = cross / double_area;
      frame.col(1) = frame.col(2).cross(frame.col(0));
      for (int k = 0; k < 3; ++k) {
        block.source[k][lane] = source_row[corner[k]];
        block.target[k][lane] = target_row[t(j, k)];
      }
      for (int k = 0; k < 2; ++k) {
        const Eigen::Vector3d flux =
            frame.transpose() * corner_flux.row(3 * static_cast<Index>(j) + k).transpose();
        for (int c = 0; c < 3; ++c) block.flux[k][c][lane] = flux[c];
      }
    }
  }
}

void GradientPass::add_to(double* right_hand_side, const double* base, bool rotation_only) const {
  kernels().gradient_pass(static_cast<int>(blocks_.size()), blocks_.data(), base, rotation_only,
                          right_hand_side);
}

}  // namespace dd
