// SPDX-License-Identifier: GPL-3.0-or-later
#include "methods/examples/joint_rigid_motion.h"

#include "support/rotations.h"

namespace dd {

namespace {

// Weights of a handle's own rotation in the covariance matrix, beside 1 for the mean of its
// vertices: of the vertices about their mean, and, a squared length in the unit box, of the
// handle's matrix. The matrix only decides where positions leave the rotation open, as with single
// vertices.
constexpr double kVerticesWeight = 0.1, kMatrixWeight = 1e-12;

}  // namespace

JointRigidMotions::JointRigidMotions(const BoundSurface& bound)
    : bound_(bound), vertices_(static_cast<size_t>(bound.region.handle_count)) {
  const std::vector<int>& rims = bound.poisson->rims();
  fixed_ = vertices_.empty() || (!rims.empty() && rims.back() >= bound.order().fixed_begin);
  for (int v : bound.region.handle_vertices) vertices_[bound.region.role[v]].push_back(v);
  const std::vector<Eigen::Matrix3d> still(vertices_.size(), Eigen::Matrix3d::Identity());
  for (const Positions& example : bound.examples)
    of_examples_.push_back(
        fit([&](int v) { return Eigen::RowVector3d(example.row(v)); }, still, {}));
}

std::vector<Positions> JointRigidMotions::examples() const {
  std::vector<Positions> result = bound_.examples;
  if (fixed_) return result;
  for (size_t i = 0; i < result.size(); ++i)
    for (Index v = 0; v < result[i].rows(); ++v)
      result[i].row(v) = of_examples_[i].undo(result[i].row(v));
  return result;
}

JointRigidMotion JointRigidMotions::of(const Rows& offsets,
                                       const std::vector<Eigen::Matrix3d>& linear,
                                       const std::vector<char>& free) const {
  return fit(
      [&](int v) -> Eigen::RowVector3d {
        return bound_.mesh.positions.row(v) +
               offsets.row(bound_.order().row_of_vertex[v]).head<3>();
      },
      linear, free);
}

template <class PositionOf>
JointRigidMotion JointRigidMotions::fit(const PositionOf& position_of,
                                        const std::vector<Eigen::Matrix3d>& linear,
                                        const std::vector<char>& free) const {
  JointRigidMotion joint_motion;
  if (fixed_) return joint_motion;
  const Index count = static_cast<Index>(vertices_.size());
  Positions from = Positions::Zero(count, 3), to = from;
  Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
  for (Index h = 0; h < count; ++h) {
    const std::vector<int>& own = vertices_[size_t(h)];
    const double vertex_weight = 1.0 / static_cast<double>(own.size());
    for (int v : own) {
      from.row(h) += vertex_weight * bound_.mesh.positions.row(v);
      to.row(h) += vertex_weight * position_of(v);
    }
    if (!free.empty() && free[size_t(h)]) continue;
    for (int v : own)
      moments += kVerticesWeight * vertex_weight * (position_of(v) - to.row(h)).transpose() *
                 (bound_.mesh.positions.row(v) - from.row(h));
    moments += kMatrixWeight * linear[size_t(h)];
  }
  joint_motion.from = from.colwise().mean();
  joint_motion.to = to.colwise().mean();
  moments += (to.rowwise() - joint_motion.to).transpose() * (from.rowwise() - joint_motion.from);
  joint_motion.rotation = polar_rotation(moments);
  return joint_motion;
}

double JointRigidMotions::bytes() const {
  return static_cast<double>(of_examples_.size() * sizeof(JointRigidMotion) +
                             bound_.region.handle_vertices.size() * sizeof(int));
}

}  // namespace dd
