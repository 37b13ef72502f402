// SPDX-License-Identifier: GPL-3.0-or-later
#include "methods/examples/stance.h"

#include "support/rotations.h"

namespace dd {

namespace {

// Weights of a handle's own rotation in the covariance matrix, beside 1 for the mean of its
// vertices: kOfVertices for the vertices about their mean, kOfMatrix, a squared length in the unit
// box, for its matrix. kOfMatrix only decides where positions leave the rotation open, as with
// single vertices.
constexpr double kOfVertices = 0.1, kOfMatrix = 1e-12;

}  // namespace

Stances::Stances(const BoundSurface& bound)
    : bound_(bound), vertices_(static_cast<size_t>(bound.region.handle_count)) {
  const std::vector<int>& rims = bound.poisson->rims();
  fixed_ = vertices_.empty() || (!rims.empty() && rims.back() >= bound.order().fixed_begin);
  for (int v : bound.region.handle_vertices) vertices_[bound.region.role[v]].push_back(v);
  const std::vector<Eigen::Matrix3d> still(vertices_.size(), Eigen::Matrix3d::Identity());
  for (const Positions& example : bound.examples)
    of_examples_.push_back(
        fit([&](int v) { return Eigen::RowVector3d(example.row(v)); }, still, {}));
}

std::vector<Positions> Stances::examples() const {
  std::vector<Positions> result = bound_.examples;
  if (fixed_) return result;
  for (size_t i = 0; i < result.size(); ++i)
    for (Index v = 0; v < result[i].rows(); ++v)
      result[i].row(v) = of_examples_[i].take_back(result[i].row(v));
  return result;
}

Stance Stances::of(const Rows& offsets, const std::vector<Eigen::Matrix3d>& linear,
                   const std::vector<char>& free) const {
  return fit(
      [&](int v) -> Eigen::RowVector3d {
        return bound_.mesh.positions.row(v) +
               offsets.row(bound_.order().row_of_vertex[v]).head<3>();
      },
      linear, free);
}

template <class PlaceOf>
Stance Stances::fit(const PlaceOf& place_of, const std::vector<Eigen::Matrix3d>& linear,
                    const std::vector<char>& free) const {
  Stance stance;
  if (fixed_) return stance;
  const Index count = static_cast<Index>(vertices_.size());
  Positions from = Positions::Zero(count, 3), to = from;
  Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
  for (Index h = 0; h < count; ++h) {
    const std::vector<int>& own = vertices_[size_t(h)];
    const double share = 1.0 / static_cast<double>(own.size());
    for (int v : own) {
      from.row(h) += share * bound_.mesh.positions.row(v);
      to.row(h) += share * place_of(v);
    }
    if (!free.empty() && free[size_t(h)]) continue;
    for (int v : own)
      moments += kOfVertices * share * (place_of(v) - to.row(h)).transpose() *
                 (bound_.mesh.positions.row(v) - from.row(h));
    moments += kOfMatrix * linear[size_t(h)];
  }
  stance.from = from.colwise().mean();
  stance.to = to.colwise().mean();
  moments += (to.rowwise() - stance.to).transpose() * (from.rowwise() - stance.from);
  stance.turn = polar_rotation(moments);
  return stance;
}

double Stances::bytes() const {
  return static_cast<double>(of_examples_.size() * sizeof(Stance) +
                             bound_.region.handle_vertices.size() * sizeof(int));
}

}  // namespace dd
