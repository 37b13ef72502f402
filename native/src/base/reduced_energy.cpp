// SPDX-License-Identifier: GPL-3.0-or-later
#include "base/reduced_energy.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <utility>

#include "base/rotation_clusters.h"
#include "support/rotations.h"

namespace dd {

namespace {

constexpr int kMaxLocalGlobalSteps = 60;
// A global step goes this far beyond its minimizer, which takes fewer steps.
constexpr double kOverRelaxation = 1.5;
// Largest change of an entry of a linear part, which has no unit, in the last step.
constexpr double kMaxConvergedChange = 1e-5;
// Regularization, as a fraction of the stiffness matrix' largest diagonal entry: without it the
// matrix may be singular for a handle whose vertices lie in a plane, on a line or in one point.
constexpr double kRegularization = 1e-9;

}  // namespace

ReducedEnergy::ReducedEnergy(const BoundSurface& bound, std::vector<char> free,
                             const Eigen::VectorXd& limbs)
    : bound_(bound), free_(std::move(free)) {
  for (size_t h = 0; h < free_.size(); ++h)
    if (free_[h]) free_handles_.push_back(static_cast<int>(h));
  RowMatrix space;
  const RowMatrix& basis_functions = bound.extension.basis_functions(space);
  if (limbs.size() > 0)
    gather_spokes(limbs, basis_functions);
  else
    gather_triangles(basis_functions);
  if (!bound.outside_base()) gather_energy_rows(basis_functions);
}

void ReducedEnergy::gather_triangles(const RowMatrix& basis_functions) {
  const Triangles& t = bound_.operators.triangles;
  const RotationClusters clusters = triangle_clusters(bound_, free_handles_);
  std::vector<std::vector<int>> triangles(size_t(clusters.count));
  for (size_t j = 0; j < clusters.of.size(); ++j)
    if (clusters.of[j] >= 0) triangles[clusters.of[j]].push_back(static_cast<int>(j));
  gather_covariances(clusters.count, bound_.base, basis_functions, [&](int k, const auto& add) {
    for (int j : triangles[k]) {
      const Eigen::Matrix3d flux = corner_divergences(bound_.operators.metric, bound_.base, t, j);
      for (int c = 0; c < 3; ++c) add(t(j, c), flux.col(c).transpose());
    }
  });
}

void ReducedEnergy::gather_spokes(const Eigen::VectorXd& limbs, const RowMatrix& basis_functions) {
  const RotationClusters clusters = vertex_clusters(bound_, free_handles_, limbs);
  const Positions& rest = bound_.base;
  std::vector<std::vector<int>> vertices(size_t(clusters.count));
  for (size_t v = 0; v < clusters.of.size(); ++v)
    if (clusters.of[v] >= 0) vertices[clusters.of[v]].push_back(static_cast<int>(v));
  gather_covariances(clusters.count, rest, basis_functions, [&](int k, const auto& add) {
    for (int v : vertices[k])
      for (SparseMatrix::InnerIterator it(bound_.operators.laplacian, v); it; ++it) {
        const int other = static_cast<int>(it.row());
        if (other == v) continue;
        // Both ends have a half of an edge, unless one of them has no rotation of its own.
        const double weight = (clusters.of[other] < 0 ? -1 : -0.5) * it.value();
        const Eigen::RowVector3d edge = weight * (rest.row(v) - rest.row(other));
        add(v, edge);
        add(other, -edge);
      }
  });
}

template <class Flux>
void ReducedEnergy::gather_covariances(int count, const Positions& rest,
                                       const RowMatrix& basis_functions, const Flux& flux) {
  cluster_count_ = count;
  const Mesh& mesh = bound_.mesh;
  const Region& region = bound_.region;
  const RowOrder& order = bound_.order();
  const HandleCoordinates& coordinates = bound_.coordinates;
  rest_covariance_ = RowMatrix::Zero(3 * Index(count), 3);
  if (!bound_.outside_base())
    covariance_basis_ = RowMatrix::Zero(3 * Index(count), coordinates.count());
  Positions sums = Positions::Zero(mesh.vertex_count(), 3);
  for (int k = 0; k < count; ++k) {
    std::vector<int> touched;
    flux(k, [&](int v, const Eigen::RowVector3d& value) {
      sums.row(v) += value;
      touched.push_back(v);
    });
    std::sort(touched.begin(), touched.end());
    touched.erase(std::unique(touched.begin(), touched.end()), touched.end());
    std::vector<Corner> corners;
    for (int v : touched) {
      const Eigen::Vector3d corner_flux = sums.row(v);
      const int row = order.row_of_vertex[v], role = region.role[v];
      rest_covariance_.middleRows<3>(3 * Index(k)) += corner_flux * rest.row(v);
      if (k < static_cast<int>(free_handles_.size())) corners.push_back({row, corner_flux});
      sums.row(v).setZero();
      if (bound_.outside_base()) continue;
      if (row < order.free_count)
        covariance_basis_.middleRows<3>(3 * Index(k)) += corner_flux * basis_functions.row(row);
      else if (role >= 0)
        covariance_basis_.block(3 * Index(k), coordinates.begin(role), 3,
                                coordinates.count(role)) +=
            corner_flux * coordinates.at(mesh.positions.row(v), role);
    }
    if (k < static_cast<int>(free_handles_.size())) cluster_corners_.push_back(std::move(corners));
  }
}

void ReducedEnergy::gather_energy_rows(const RowMatrix& basis_functions) {
  const Mesh& mesh = bound_.mesh;
  const Region& region = bound_.region;
  const RowOrder& order = bound_.order();
  const HandleCoordinates& coordinates = bound_.coordinates;
  const Index columns = coordinates.count();
  // Accumulated over blocks of vertices, by a dense product for each: more vertices take more
  // memory.
  constexpr int kVerticesPerProduct = 64;
  std::vector<Index> own, own_begin(free_.size(), -1);
  for (int h : free_handles_) {
    own_begin[size_t(h)] = Index(own.size());
    for (int k = 0; k < coordinates.count(h); ++k) own.push_back(coordinates.begin(h) + k);
  }
  RowMatrix own_space;
  if (Index(own.size()) < columns) own_space = basis_functions(kAllIndices, own);
  const RowMatrix& own_functions = own_space.size() ? own_space : basis_functions;
  energy_rows_ = RowMatrix::Zero(Index(own.size()), columns);
  RowMatrix left(kVerticesPerProduct, energy_rows_.rows()), right(kVerticesPerProduct, columns);
  int filled = 0;
  const auto flush = [&] {
    energy_rows_.noalias() += left.topRows(filled).transpose() * right.topRows(filled);
    filled = 0;
  };
  for (int v = 0; v < mesh.vertex_count(); ++v) {
    const int own_row = order.row_of_vertex[v], own_role = region.role[v];
    if (own_role == kFixed) continue;
    left.row(filled).setZero();
    for (SparseMatrix::InnerIterator it(bound_.operators.laplacian, v); it; ++it) {
      const int row = order.row_of_vertex[it.row()], role = region.role[it.row()];
      if (row < order.free_count)
        left.row(filled) += it.value() * own_functions.row(row);
      else if (role >= 0 && own_begin[size_t(role)] >= 0)
        left.row(filled).segment(own_begin[size_t(role)], coordinates.count(role)) +=
            it.value() * coordinates.at(mesh.positions.row(it.row()), role);
    }
    if (own_row < order.free_count) {
      right.row(filled) = basis_functions.row(own_row);
    } else {
      right.row(filled).setZero();
      right.row(filled).segment(coordinates.begin(own_role), coordinates.count(own_role)) =
          coordinates.at(mesh.positions.row(v), own_role);
    }
    if (++filled == kVerticesPerProduct) flush();
  }
  flush();
}

/// The unknowns of a pose, and the linear system of a global step.
struct ReducedEnergy::Problem {
  // C = [(A − I)ᵀ; A o − o]. For a free handle C = Tᵀ X + [0; pivot' − pivot], with the unknown X =
  // (A − I)ᵀ and T = [I, o − pivot]. T is zero for a handle of one point that is its pivot.
  struct Unknown {
    size_t free_index;                                                  // index into free_handles_
    Index first_row;                                                    // in energy_rows_
    Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::ColMajor, 3, 4> T;  // in reduced coordinates
  };
  std::vector<Unknown> unknowns;
  RowMatrix prescribed_coordinates;  // of all handles, with X = 0
  RowMatrix X, stiffness, forces;    // of all unknowns, three rows each
  RowMatrix prescribed_covariances;  // of the clusters, with X = 0
  RowMatrix covariance_of_unknowns;  // what each row of X adds to them
};

ReducedEnergy::Problem ReducedEnergy::set_up(const std::vector<Affine>& motions,
                                             const Positions& pivots) const {
  const HandleCoordinates& coordinates = bound_.coordinates;
  const Index handle_count = Index(free_.size());
  Problem problem;
  RowMatrix given = RowMatrix::Zero(4 * handle_count, 3);
  size_t free_index = 0;
  Index first_row = 0;
  for (Index h = 0; h < handle_count; ++h) {
    const Eigen::Vector3d o = coordinates.centres().row(h), pivot = pivots.row(h);
    const auto A = motions[size_t(h)].leftCols<3>();
    auto block = given.middleRows<4>(4 * h);
    if (!free_[size_t(h)]) {
      block.topRows<3>() = A.transpose() - Eigen::Matrix3d::Identity();
      block.row(3) = (A * o + motions[size_t(h)].col(3) - o).transpose();
      continue;
    }
    const Eigen::Vector3d deformed_pivot = A * pivot + motions[size_t(h)].col(3);
    block.row(3) = (deformed_pivot - pivot).transpose();
    Eigen::Matrix<double, 3, 4> T;
    T << Eigen::Matrix3d::Identity(), o - pivot;
    const int handle = static_cast<int>(h);
    Problem::Unknown unknown{free_index++, first_row,
                             T * coordinates.reduction(handle).transpose()};
    if (!unknown.T.isZero()) problem.unknowns.push_back(std::move(unknown));
    first_row += coordinates.count(handle);
  }
  problem.prescribed_coordinates = coordinates.reduced(given);
  return problem;
}

void ReducedEnergy::assemble(const std::vector<Eigen::Matrix3d>& initial, Problem& problem) const {
  const HandleCoordinates& coordinates = bound_.coordinates;
  const RowMatrix prescribed_forces = energy_rows_ * problem.prescribed_coordinates;
  const Index count = Index(problem.unknowns.size());
  problem.X.resize(3 * count, 3);
  problem.forces.resize(3 * count, 3);
  problem.stiffness.resize(3 * count, 3 * count);
  problem.covariance_of_unknowns.resize(3 * cluster_count_, 3 * count);
  for (Index i = 0; i < count; ++i) {
    const auto& [free_index, first_row, T] = problem.unknowns[size_t(i)];
    const Index width = T.cols();
    problem.covariance_of_unknowns.middleCols<3>(3 * i) =
        covariance_basis_.middleCols(coordinates.begin(free_handles_[free_index]), width) *
        T.transpose();
    for (Index k = 0; k < count; ++k) {
      const Problem::Unknown& other = problem.unknowns[size_t(k)];
      problem.stiffness.block<3, 3>(3 * i, 3 * k) =
          T *
          energy_rows_.block(first_row, coordinates.begin(free_handles_[other.free_index]), width,
                             other.T.cols()) *
          other.T.transpose();
    }
    problem.forces.middleRows<3>(3 * i) = T * prescribed_forces.middleRows(first_row, width);
    problem.X.middleRows<3>(3 * i) = initial[free_index].transpose() - Eigen::Matrix3d::Identity();
  }
  if (count > 0)
    problem.stiffness.diagonal().array() +=
        kRegularization * problem.stiffness.diagonal().maxCoeff();
  problem.prescribed_covariances =
      rest_covariance_ + covariance_basis_ * problem.prescribed_coordinates;
}

std::vector<Eigen::Matrix3d> ReducedEnergy::minimize(
    const std::vector<Affine>& motions, const Positions& pivots,
    const std::vector<Eigen::Matrix3d>& initial) const {
  Problem problem = set_up(motions, pivots);
  assemble(initial, problem);
  const Eigen::LDLT<Eigen::MatrixXd> factor{Eigen::MatrixXd(problem.stiffness)};
  RowMatrix rotations(3 * cluster_count_, 3);  // R_kᵀ − I
  const auto rotate_first = [&](Index count) {
    const RowMatrix covariances = problem.prescribed_covariances.topRows(3 * count) +
                                  problem.covariance_of_unknowns.topRows(3 * count) * problem.X;
    for (Index k = 0; k < count; ++k)
      rotations.middleRows<3>(3 * k) =
          polar_rotation(covariances.middleRows<3>(3 * k).transpose()).transpose() -
          Eigen::Matrix3d::Identity();
  };
  for (int step = 0; step < kMaxLocalGlobalSteps && !problem.unknowns.empty(); ++step) {
    rotate_first(cluster_count_);
    const RowMatrix minimizer =
        factor.solve(problem.covariance_of_unknowns.transpose() * rotations - problem.forces);
    const RowMatrix change = minimizer - problem.X;
    problem.X += kOverRelaxation * change;
    if (change.cwiseAbs().maxCoeff() < kMaxConvergedChange) break;
  }
  rotate_first(Index(free_handles_.size()));
  std::vector<Eigen::Matrix3d> result;
  result.reserve(free_handles_.size());
  for (Index i = 0; i < Index(free_handles_.size()); ++i)
    result.push_back((rotations.middleRows<3>(3 * i) + Eigen::Matrix3d::Identity()).transpose());
  return result;
}

std::vector<Eigen::Matrix3d> ReducedEnergy::rotations_of(const Rows& base) const {
  std::vector<Eigen::Matrix3d> result;
  for (const std::vector<Corner>& corners : cluster_corners_) {
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
    for (const Corner& corner : corners)
      covariance += base.row(corner.row).head<3>().transpose() * corner.flux.transpose();
    result.push_back(polar_rotation(covariance));
  }
  return result;
}

double ReducedEnergy::bytes() const {
  size_t corners = 0;
  for (const auto& of_cluster : cluster_corners_) corners += of_cluster.size();
  return static_cast<double>(energy_rows_.size() + covariance_basis_.size() +
                             rest_covariance_.size()) *
             sizeof(double) +
         static_cast<double>(corners * sizeof(Corner));
}

}  // namespace dd
