// SPDX-License-Identifier: GPL-3.0-or-later
#include "reconstruction/gradients.h"

#include <Eigen/Geometry>
#include <algorithm>

#include "mesh/topology.h"

namespace dd {

namespace {

// Thresholds up to which a triangle has no area, see StandIns. Longest edge as a fraction of the
// size of S. Safety: three corners that nearly coincide.
constexpr double kMinEdgeOfSize = 1e-9;
// Height as a fraction of the longest edge. Tuned: below it rounding of the base became a rotation,
// 1e-6 of the box on meshes with free limbs.
constexpr double kMinHeightOfEdge = 1e-2;
// Height as a fraction of the size of S. Tuned: with kMinHeightOfEdge alone a plane of 1 : 100
// needles moves 2.6% of the box away from the result of squares; with both limits 0.12%.
constexpr double kMinHeightOfSize = 1e-5;

bool has_area(const Positions& p, const Triangles& t, Index j, double size) {
  const Eigen::Vector3d a = p.row(t(j, 0)), b = p.row(t(j, 1)), c = p.row(t(j, 2));
  const double longest = std::max({(b - a).norm(), (c - b).norm(), (a - c).norm()});
  const double height = (b - a).cross(c - a).norm() / longest;  // NaN if all corners coincide
  return longest > kMinEdgeOfSize * size &&
         (height > kMinHeightOfEdge * longest || height > kMinHeightOfSize * size);
}

}  // namespace

StandIns stand_ins(const Positions& surface, const Triangles& t, double size,
                   const Positions* moved) {
  const int m = static_cast<int>(t.rows());
  StandIns result;
  result.of_triangle.assign(static_cast<size_t>(m), -1);
  bool all = true;
  for (int j = 0; j < m; ++j) {
    if (has_area(surface, t, j, size) && (!moved || has_area(*moved, t, j, size)))
      result.of_triangle[j] = j;
    else
      all = false;
  }
  if (!all) fill_from_neighbours(result.of_triangle, t, static_cast<int>(surface.rows()));
  return result;
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
  for (int section = 0; section < active.sections(); ++section)
    begin.push_back(begin.back() +
                    (active.begin[section + 1] - active.begin[section] + kLanes - 1) / kLanes);
}

template <class Real>
GradientPass<Real>::GradientPass(const FactoredSurface& surface, const Positions& base,
                                 const StandIns& stand_ins)
    : layout_(surface.poisson->active()),
      blocks_(layout_.discarding_blocks<TriangleBlock<Real>>(*surface.poisson)) {
  const PoissonSystem& poisson = *surface.poisson;
  const Triangles& t = surface.operators.triangles;
  const auto place = [&](int i, int section, int b, int lane) {
    TriangleBlock<Real>& block = blocks_[b];
    const int j = poisson.active().triangles[i], stand_in = stand_ins.of_triangle[j];
    if (stand_in < 0) return;
    const RestFrame frame(base, t, stand_in);
    put(block.shape, lane, frame);
    for (int k = 0; k < 3; ++k) {
      block.source[k][lane] = poisson.order().row_of_vertex[t(stand_in, k)];
      block.target[k][lane] = poisson.right_hand_side_row(section, t(j, k));
    }
    const Eigen::Matrix3d corner_flux =
        corner_divergences(surface.operators.metric, surface.mesh.positions, t, j);
    for (int k = 0; k < 2; ++k) {
      const Eigen::Vector3d flux = frame.axes.transpose() * corner_flux.col(k);
      for (int c = 0; c < 3; ++c) block.flux[k][c][lane] = static_cast<Real>(flux[c]);
    }
  };
  layout_.each(poisson.active(), place, &poisson.pool());
}

template <class Real>
std::vector<RotationBlock<Real>> rotation_blocks(const Positions& rest, const Triangles& t,
                                                 const std::vector<int>& which,
                                                 const StandIns& stand_ins, const RowOrder& order) {
  std::vector<RotationBlock<Real>> blocks((which.size() + kLanes - 1) / kLanes);
  for (size_t i = 0; i < blocks.size() * kLanes; ++i) {
    RotationBlock<Real>& block = blocks[i / kLanes];
    const int lane = static_cast<int>(i % kLanes);
    block.from_rest[3][lane] = 1;
    const int stand_in = i < which.size() ? stand_ins.of_triangle[which[i]] : -1;
    // padding, or no stand-in: without a shape, its rotation will be zero
    if (stand_in < 0) continue;
    const RestFrame frame(rest, t, stand_in);
    for (int k = 0; k < 3; ++k) block.source[k][lane] = order.row_of_vertex[t(stand_in, k)];
    put(block.shape, lane, frame);
    const Eigen::Quaterniond from_rest(Eigen::Matrix3d(frame.axes.transpose()));
    for (int c = 0; c < 4; ++c) block.from_rest[c][lane] = static_cast<Real>(from_rest.coeffs()[c]);
  }
  return blocks;
}

template class GradientPass<float>;
template class GradientPass<double>;
template std::vector<RotationBlock<float>> rotation_blocks(const Positions&, const Triangles&,
                                                           const std::vector<int>&, const StandIns&,
                                                           const RowOrder&);
template std::vector<RotationBlock<double>> rotation_blocks(const Positions&, const Triangles&,
                                                            const std::vector<int>&,
                                                            const StandIns&, const RowOrder&);

}  // namespace dd
