// SPDX-License-Identifier: GPL-3.0-or-later
#include "tets.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <string>
#include <utility>

#include "handle_blend.h"

namespace dd {

namespace {

double signed_volume(const TetMesh& mesh, Index j) {
  const Eigen::Vector3d a = mesh.positions.row(mesh.tets(j, 0)), b = mesh.positions.row(mesh.tets(j, 1)),
                        c = mesh.positions.row(mesh.tets(j, 2)), d = mesh.positions.row(mesh.tets(j, 3));
  return (b - a).cross(c - a).dot(d - a) / 6;
}

std::vector<int> checked_free(const TetMesh& mesh, const std::vector<int>& roles, int handle_count) {
  std::vector<int> free;
  bool any_held = false;
  for (int v = 0; v < mesh.vertex_count(); ++v) {
    if (roles[v] < kFixed || roles[v] >= handle_count)
      throw Error(Status::region, "Vertex " + std::to_string(v) + " has the role " +
                                      std::to_string(roles[v]) + ", which is no handle.");
    if (roles[v] == kFree)
      free.push_back(v);
    else
      any_held = true;
  }
  if (free.empty()) throw Error(Status::region, "No vertex is free to follow.");
  if (!any_held) throw Error(Status::region, "Nothing holds the mesh: fix some vertices.");
  return free;
}

SparseMatrix block(const SparseMatrix& matrix, const std::vector<int>& chosen) {
  std::vector<int> row(static_cast<size_t>(matrix.rows()), -1);
  for (size_t r = 0; r < chosen.size(); ++r) row[chosen[r]] = static_cast<int>(r);
  std::vector<Eigen::Triplet<double>> entries;
  for (int v : chosen)
    for (SparseMatrix::InnerIterator it(matrix, v); it; ++it)
      if (row[it.row()] >= 0) entries.emplace_back(row[it.row()], row[v], it.value());
  SparseMatrix result(static_cast<Index>(chosen.size()), static_cast<Index>(chosen.size()));
  result.setFromTriplets(entries.begin(), entries.end());
  return result;
}

SparseCholesky factored(const SparseMatrix& laplacian, const std::vector<int>& free) {
  try {
    return SparseCholesky(block(laplacian, free));
  } catch (const SingularMatrix& singular) {
    throw Error(Status::numeric,
                "The solid can't be solved for near vertex " + std::to_string(free[singular.row()]) +
                    ": nothing holds the part that it belongs to.");
  }
}

}  // namespace

void validate(const TetMesh& mesh) {
  if (mesh.tet_count() == 0) throw Error(Status::mesh, "The mesh has no tetrahedra.");
  for (int v = 0; v < mesh.vertex_count(); ++v)
    if (!mesh.positions.row(v).allFinite())
      throw Error(Status::mesh, "Vertex " + std::to_string(v) + " is not finite.");
  for (Index j = 0; j < mesh.tet_count(); ++j) {
    const std::string name = "Tetrahedron " + std::to_string(j);
    for (int k = 0; k < 4; ++k)
      if (mesh.tets(j, k) < 0 || mesh.tets(j, k) >= mesh.vertex_count())
        throw Error(Status::mesh, name + " refers to vertex " + std::to_string(mesh.tets(j, k)) +
                                      ", which there is not.");
    double longest = 0;
    for (int k = 1; k < 4; ++k)
      longest = std::max(longest, (mesh.positions.row(mesh.tets(j, k)) -
                                   mesh.positions.row(mesh.tets(j, 0)))
                                      .norm());
    if (!(std::abs(signed_volume(mesh, j)) > 1e-14 * longest * longest * longest))
      throw Error(Status::mesh, name + " has no volume.");
  }
}

Eigen::VectorXd volumes(const TetMesh& mesh) {
  Eigen::VectorXd result(mesh.tet_count());
  for (Index j = 0; j < mesh.tet_count(); ++j) result[j] = std::abs(signed_volume(mesh, j));
  return result;
}

SparseMatrix gradient(const TetMesh& mesh) {
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(static_cast<size_t>(mesh.tet_count()) * 12);
  for (Index j = 0; j < mesh.tet_count(); ++j)
    for (int k = 0; k < 4; ++k) {
      const Eigen::Vector3d a = mesh.positions.row(mesh.tets(j, (k + 1) % 4)),
                            b = mesh.positions.row(mesh.tets(j, (k + 2) % 4)),
                            c = mesh.positions.row(mesh.tets(j, (k + 3) % 4)),
                            own = mesh.positions.row(mesh.tets(j, k));
      const Eigen::Vector3d normal = (b - a).cross(c - a);
      const Eigen::Vector3d value = normal / normal.dot(own - a);
      for (int row = 0; row < 3; ++row)
        entries.emplace_back(static_cast<int>(3 * j + row), mesh.tets(j, k), value[row]);
    }
  SparseMatrix G(3 * mesh.tet_count(), mesh.vertex_count());
  G.setFromTriplets(entries.begin(), entries.end());
  return G;
}

SparseMatrix deformation_operator(const TetMesh& mesh) {
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(static_cast<size_t>(mesh.tet_count()) * 12);
  for (Index j = 0; j < mesh.tet_count(); ++j) {
    Eigen::Matrix3d V;
    for (int k = 0; k < 3; ++k)
      V.col(k) = mesh.positions.row(mesh.tets(j, k)) - mesh.positions.row(mesh.tets(j, 3));
    const Eigen::Matrix3d inverse = V.inverse();
    for (int row = 0; row < 3; ++row) {
      for (int k = 0; k < 3; ++k)
        entries.emplace_back(static_cast<int>(3 * j + row), mesh.tets(j, k), inverse(k, row));
      entries.emplace_back(static_cast<int>(3 * j + row), mesh.tets(j, 3), -inverse.col(row).sum());
    }
  }
  SparseMatrix G(3 * mesh.tet_count(), mesh.vertex_count());
  G.setFromTriplets(entries.begin(), entries.end());
  return G;
}

TetPoisson::TetPoisson(const TetMesh& mesh, const std::vector<int>& roles, int handle_count,
                       SparseMatrix operator_, const Eigen::VectorXd& weights)
    : rest_(mesh.positions),
      roles_(roles),
      free_(checked_free(mesh, roles, handle_count)),
      handle_count_(handle_count),
      gradient_(std::move(operator_)),
      weighted_(gradient_.transpose() *
                Eigen::VectorXd(weights.transpose().replicate(3, 1).reshaped()).asDiagonal()),
      laplacian_(weighted_ * gradient_),
      factor_(factored(laplacian_, free_)) {}

Positions TetPoisson::solve(const Positions& constrained, const RowMatrix& gradients) const {
  // For the displacement from rest, whose gradients are the wanted ones less I: see PoissonSystem.
  Positions displacement = constrained - rest_;
  for (int v : free_) displacement.row(v).setZero();
  RowMatrix change = gradients;
  for (Index row = 0; row < change.rows(); ++row) change(row, row % 3) -= 1;
  const RowMatrix right = weighted_ * change - laplacian_ * displacement;
  RowMatrix rows(static_cast<Index>(free_.size()), 3);
  for (size_t r = 0; r < free_.size(); ++r) rows.row(Index(r)) = right.row(free_[r]);
  rows = factor_.solve(rows);
  for (size_t r = 0; r < free_.size(); ++r) displacement.row(free_[r]) = rows.row(Index(r));
  return rest_ + displacement;
}

RowMatrix TetPoisson::harmonic_weights() const {
  RowMatrix weights = RowMatrix::Zero(rest_.rows(), handle_count_);
  for (size_t v = 0; v < roles_.size(); ++v)
    if (roles_[v] >= 0) weights(Index(v), roles_[v]) = 1;
  const RowMatrix right = -(laplacian_ * weights);
  RowMatrix rows(static_cast<Index>(free_.size()), handle_count_);
  for (size_t r = 0; r < free_.size(); ++r) rows.row(Index(r)) = right.row(free_[r]);
  rows = factor_.solve(rows);
  for (size_t r = 0; r < free_.size(); ++r) weights.row(free_[r]) = rows.row(Index(r));
  return weights;
}

Positions edit_by_gradients(const TetPoisson& poisson, const TetMesh& mesh,
                            const std::vector<int>& roles, int handle_count,
                            const double* matrices) {
  using Affine = Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>;
  std::vector<Eigen::Matrix3d> linear;
  for (int h = 0; h < handle_count; ++h) {
    const Affine matrix(matrices + 12 * static_cast<Index>(h));
    if (!matrix.allFinite())
      throw Error(Status::argument, "The matrix of handle " + std::to_string(h) + " is not finite.");
    linear.push_back(matrix.leftCols<3>());
  }
  Positions constrained = mesh.positions;
  for (int v = 0; v < mesh.vertex_count(); ++v) {
    if (roles[v] < 0) continue;
    const Affine matrix(matrices + 12 * static_cast<Index>(roles[v]));
    constrained.row(v) = (matrix.leftCols<3>() * mesh.positions.row(v).transpose() + matrix.col(3)).transpose();
  }
  const RowMatrix of_vertices = poisson.harmonic_weights();
  RowMatrix weights(mesh.tet_count(), handle_count);
  for (Index j = 0; j < mesh.tet_count(); ++j)
    weights.row(j) = (of_vertices.row(mesh.tets(j, 0)) + of_vertices.row(mesh.tets(j, 1)) +
                      of_vertices.row(mesh.tets(j, 2)) + of_vertices.row(mesh.tets(j, 3))) /
                     4;
  const HandleBlend blend(linear, weights, false);
  RowMatrix gradients(3 * mesh.tet_count(), 3);
  for (Index j = 0; j < mesh.tet_count(); ++j)
    gradients.middleRows<3>(3 * j) = blend.at(j).transpose();
  return poisson.solve(constrained, gradients);
}

}  // namespace dd
