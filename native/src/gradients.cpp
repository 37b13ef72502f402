// SPDX-License-Identifier: GPL-3.0-or-later
#include "gradients.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>

namespace dd {

namespace {

constexpr double kShortest = 1e-9;  // of the surface's size
constexpr double kFlattest = 1e-2;  // height over longest edge

bool has_area(const Positions& p, const Triangles& t, Index j, double shortest) {
  const Eigen::Vector3d a = p.row(t(j, 0)), b = p.row(t(j, 1)), c = p.row(t(j, 2));
  const double longest = std::max({(b - a).norm(), (c - b).norm(), (a - c).norm()});
  return longest > shortest && (b - a).cross(c - a).norm() > kFlattest * longest * longest;
}

/// What joins triangles: for each corner k of a triangle the edge after it, or the corner itself.
enum class Join { edges, vertices };

/// Breadth first from the triangles that have a source into those joined to them that have none.
/// Every edge or vertex is passed through once; triangles are visited in order, so that the result
/// depends on nothing but the mesh.
void spread(std::vector<int>& source_of, const Triangles& t, Join join) {
  std::vector<std::array<int, 3>> joints;  // low vertex, high vertex, 3 × triangle + corner
  joints.reserve(static_cast<size_t>(t.size()));
  for (Index j = 0; j < t.rows(); ++j) {
    for (int k = 0; k < 3; ++k) {
      const auto [low, high] = std::minmax(t(j, k), t(j, join == Join::edges ? (k + 1) % 3 : k));
      joints.push_back({low, high, static_cast<int>(3 * j + k)});
    }
  }
  std::sort(joints.begin(), joints.end());
  std::vector<int> starts, joint_of(joints.size());
  for (size_t i = 0; i < joints.size(); ++i) {
    if (i == 0 || joints[i][0] != joints[i - 1][0] || joints[i][1] != joints[i - 1][1])
      starts.push_back(static_cast<int>(i));
    joint_of[joints[i][2]] = static_cast<int>(starts.size()) - 1;
  }
  starts.push_back(static_cast<int>(joints.size()));

  std::vector<int> queue;
  for (Index j = 0; j < t.rows(); ++j)
    if (source_of[j] >= 0) queue.push_back(static_cast<int>(j));
  std::vector<char> passed(starts.size(), 0);
  for (size_t head = 0; head < queue.size(); ++head) {
    const int j = queue[head];
    for (int k = 0; k < 3; ++k) {
      const int joint = joint_of[3 * static_cast<size_t>(j) + static_cast<size_t>(k)];
      if (passed[joint]) continue;
      passed[joint] = 1;
      for (int i = starts[joint]; i < starts[joint + 1]; ++i) {
        const int other = joints[i][2] / 3;
        if (source_of[other] >= 0) continue;
        source_of[other] = source_of[j];
        queue.push_back(other);
      }
    }
  }
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
  spread(sources.of_triangle, t, Join::edges);
  spread(sources.of_triangle, t, Join::vertices);
  return sources;
}

Eigen::Matrix3d edges_and_normal(const Positions& p, const Triangles& t, Index j) {
  Eigen::Matrix3d columns;
  columns.col(0) = p.row(t(j, 1)) - p.row(t(j, 0));
  columns.col(1) = p.row(t(j, 2)) - p.row(t(j, 0));
  const Eigen::Vector3d cross = columns.col(0).cross(columns.col(1));
  const double length = cross.norm();
  columns.col(2) = length > 1e-300 ? Eigen::Vector3d(cross / length) : Eigen::Vector3d::Zero();
  return columns;
}

RestFrame::RestFrame(const Positions& p, const Triangles& t, Index j) {
  const Eigen::Vector3d p0 = p.row(t(j, 0));
  const Eigen::Vector3d e1 = p.row(t(j, 1)).transpose() - p0;
  const Eigen::Vector3d e2 = p.row(t(j, 2)).transpose() - p0;
  const Eigen::Vector3d cross = e1.cross(e2);
  const double length = e1.norm(), double_area = cross.norm();
  inverse_length = 1 / length;
  shear = e1.dot(e2) / (length * double_area);
  inverse_height = length / double_area;
  axes.col(0) = e1 / length;
  axes.col(2) = cross / double_area;
  axes.col(1) = axes.col(2).cross(axes.col(0));
}

GradientPass::GradientPass(const Positions& base, const Triangles& t, const Positions& corner_flux,
                           const std::vector<int>& active, const GradientSources& sources,
                           const RowOrder& order) {
  blocks_.resize((active.size() + kLanes - 1) / kLanes);
  for (size_t b = 0; b < blocks_.size(); ++b) {
    TriangleBlock& block = blocks_[b];
    block = {};
    for (int lane = 0; lane < kLanes; ++lane) {
      for (int k = 0; k < 3; ++k) block.target[k][lane] = order.free_count;
      const size_t i = b * kLanes + static_cast<size_t>(lane);
      if (i >= active.size()) continue;
      const int j = active[i], source = sources.of_triangle[j];
      if (source < 0) continue;

      const auto corner = t.row(source);
      const RestFrame frame(base, t, source);
      block.inverse_length[lane] = frame.inverse_length;
      block.shear[lane] = frame.shear;
      block.inverse_height[lane] = frame.inverse_height;
      for (int k = 0; k < 3; ++k) {
        block.source[k][lane] = order.row_of_vertex[corner[k]];
        block.target[k][lane] = order.target_of_vertex(t(j, k));
      }
      for (int k = 0; k < 2; ++k) {
        const Eigen::Vector3d flux =
            frame.axes.transpose() * corner_flux.row(3 * static_cast<Index>(j) + k).transpose();
        for (int c = 0; c < 3; ++c) block.flux[k][c][lane] = flux[c];
      }
    }
  }
}

std::vector<RotationBlock> rotation_blocks(const Positions& rest, const Triangles& t,
                                           const std::vector<int>& which,
                                           const GradientSources& sources, const RowOrder& order) {
  std::vector<RotationBlock> blocks((which.size() + kLanes - 1) / kLanes);
  for (size_t i = 0; i < blocks.size() * kLanes; ++i) {
    RotationBlock& block = blocks[i / kLanes];
    const size_t lane = i % kLanes;
    block.from_rest[3][lane] = 1;
    const int source = i < which.size() ? sources.of_triangle[which[i]] : -1;
    if (source < 0) continue;  // no area anywhere near, or no triangle: the identity
    const RestFrame frame(rest, t, source);
    for (int k = 0; k < 3; ++k) block.source[k][lane] = order.row_of_vertex[t(source, k)];
    block.inverse_length[lane] = frame.inverse_length;
    block.shear[lane] = frame.shear;
    block.inverse_height[lane] = frame.inverse_height;
    const Eigen::Quaterniond from_rest(Eigen::Matrix3d(frame.axes.transpose()));
    for (int c = 0; c < 4; ++c) block.from_rest[c][lane] = from_rest.coeffs()[c];
  }
  return blocks;
}

void GradientPass::add_to(double* right_hand_side, const double* base, bool rotation_only) const {
  kernels().gradient_pass(static_cast<int>(blocks_.size()), blocks_.data(), base, rotation_only,
                          right_hand_side);
}

}  // namespace dd
