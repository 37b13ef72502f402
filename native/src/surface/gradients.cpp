// SPDX-License-Identifier: GPL-3.0-or-later
#include "surface/gradients.h"

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

void fill_from_neighbours(std::vector<int>& source_of, const Triangles& t) {
  spread(source_of, t, Join::edges);
  spread(source_of, t, Join::vertices);
}

GradientSources gradient_sources(const Positions& base, const Triangles& t, double size,
                                 const Positions* moved) {
  const double shortest = kShortest * size;
  const int m = static_cast<int>(t.rows());
  GradientSources sources;
  sources.of_triangle.assign(static_cast<size_t>(m), -1);
  for (int j = 0; j < m; ++j) {
    if (has_area(base, t, j, shortest) && (!moved || has_area(*moved, t, j, shortest)))
      sources.of_triangle[j] = j;
    else
      ++sources.borrowed_count;
  }
  if (sources.borrowed_count == 0) return sources;
  fill_from_neighbours(sources.of_triangle, t);
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
  shear = e1.dot(e2) / double_area;
  inverse_height = length * length / double_area;
  axes.col(0) = e1 / length;
  axes.col(2) = cross / double_area;
  axes.col(1) = axes.col(2).cross(axes.col(0));
}

namespace {

template <class Real>
void put(TriangleShape<Real>& shape, int lane, const RestFrame& frame) {
  shape.inverse_length[lane] = static_cast<Real>(frame.inverse_length);
  shape.shear[lane] = static_cast<Real>(frame.shear);
  shape.inverse_height[lane] = static_cast<Real>(frame.inverse_height);
}

}  // namespace

ActiveBlocks::ActiveBlocks(const ActiveTriangles& active) : begin{0} {
  for (int part = 0; part < active.parts(); ++part)
    begin.push_back(begin.back() +
                    (active.begin[part + 1] - active.begin[part] + kLanes - 1) / kLanes);
}

template <class Real>
GradientPass<Real>::GradientPass(const Positions& base, const Triangles& t,
                                 const Positions& corner_flux, const GradientSources& sources,
                                 const PoissonSystem& poisson)
    : layout_(poisson.active()), blocks_(layout_.without_targets<TriangleBlock<Real>>(poisson)) {
  layout_.each(poisson.active(), [&](int i, int part, int b, int lane) {
    TriangleBlock<Real>& block = blocks_[b];
    const int j = poisson.active().triangles[i], source = sources.of_triangle[j];
    if (source < 0) return;
    const RestFrame frame(base, t, source);
    put(block.shape, lane, frame);
    for (int k = 0; k < 3; ++k) {
      block.source[k][lane] = poisson.order().row_of_vertex[t(source, k)];
      block.target[k][lane] = poisson.target(part, t(j, k));
    }
    for (int k = 0; k < 2; ++k) {
      const Eigen::Vector3d flux =
          frame.axes.transpose() * corner_flux.row(3 * static_cast<Index>(j) + k).transpose();
      for (int c = 0; c < 3; ++c) block.flux[k][c][lane] = static_cast<Real>(flux[c]);
    }
  });
}

template <class Real>
std::vector<RotationBlock<Real>> rotation_blocks(const Positions& rest, const Triangles& t,
                                                 const std::vector<int>& which,
                                                 const GradientSources& sources,
                                                 const RowOrder& order) {
  std::vector<RotationBlock<Real>> blocks((which.size() + kLanes - 1) / kLanes);
  for (size_t i = 0; i < blocks.size() * kLanes; ++i) {
    RotationBlock<Real>& block = blocks[i / kLanes];
    const int lane = static_cast<int>(i % kLanes);
    block.from_rest[3][lane] = 1;
    const int source = i < which.size() ? sources.of_triangle[which[i]] : -1;
    if (source < 0) continue;  // no area anywhere near, or no triangle: the identity
    const RestFrame frame(rest, t, source);
    for (int k = 0; k < 3; ++k) block.source[k][lane] = order.row_of_vertex[t(source, k)];
    put(block.shape, lane, frame);
    const Eigen::Quaterniond from_rest(Eigen::Matrix3d(frame.axes.transpose()));
    for (int c = 0; c < 4; ++c) block.from_rest[c][lane] = static_cast<Real>(from_rest.coeffs()[c]);
  }
  return blocks;
}

template class GradientPass<float>;
template class GradientPass<double>;
template std::vector<RotationBlock<float>> rotation_blocks(const Positions&, const Triangles&,
                                                           const std::vector<int>&,
                                                           const GradientSources&, const RowOrder&);
template std::vector<RotationBlock<double>> rotation_blocks(const Positions&, const Triangles&,
                                                            const std::vector<int>&,
                                                            const GradientSources&,
                                                            const RowOrder&);

}  // namespace dd
