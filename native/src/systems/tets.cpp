// SPDX-License-Identifier: GPL-3.0-or-later
#include "systems/tets.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <sstream>
#include <string>
#include <utility>

#include "support/handle_blend.h"
#include "systems/free_block.h"

namespace dd {

namespace {

// Range of edge lengths, in the mesh's units. Safety: their cubes, the volumes, stay within the
// range of double.
constexpr double kMinEdge = 1e-90, kMaxEdge = 1e90;

double signed_volume(const TetMesh& mesh, Index j) {
  const Eigen::Vector3d a = mesh.positions.row(mesh.tets(j, 0)),
                        b = mesh.positions.row(mesh.tets(j, 1)),
                        c = mesh.positions.row(mesh.tets(j, 2)),
                        d = mesh.positions.row(mesh.tets(j, 3));
  return (b - a).cross(c - a).dot(d - a) / 6;
}

Region checked_region(const std::vector<int>& roles, int handle_count) {
  check_roles(roles, handle_count);
  Region region = region_of_roles(roles, handle_count);
  if (region.free.empty())
    throw Error(Status::region, "No vertex is free to follow", Remedy::free_vertices);
  if (region.free.size() == roles.size())
    throw Error(Status::region, "Nothing holds the mesh", Remedy::fix_vertices);
  return region;
}

SparseCholesky factored(const SparseMatrix& laplacian, const Region& region,
                        const Progress& progress) {
  BlockOptions options;
  options.progress = progress;
  try {
    return factor_free_block(free_block(laplacian, region), region, options);
  } catch (const UnsolvableSurface& error) {
    throw Error(
        Status::numeric, {Subject::vertex, error.vertex()},
        "lies where the solid can't be solved for: nothing holds the part that it belongs to",
        Remedy::fix_vertices);
  }
}

}  // namespace

void validate(const TetMesh& mesh) {
  if (mesh.tet_count() == 0) throw Error(Status::mesh, "The mesh has no tetrahedra");
  for (int v = 0; v < mesh.vertex_count(); ++v)
    if (!mesh.positions.row(v).allFinite())
      throw Error(Status::mesh, {Subject::vertex, v}, "is not finite", Remedy::move_vertex);
  for (Index j = 0; j < mesh.tet_count(); ++j) {
    const std::string name = "Tetrahedron " + std::to_string(j);
    for (int k = 0; k < 4; ++k)
      if (mesh.tets(j, k) < 0 || mesh.tets(j, k) >= mesh.vertex_count())
        throw Error(Status::mesh, name + " refers to vertex " + std::to_string(mesh.tets(j, k)) +
                                      ", which there is not");
    double longest = 0;
    for (int k = 1; k < 4; ++k)
      longest = std::max(
          longest,
          (mesh.positions.row(mesh.tets(j, k)) - mesh.positions.row(mesh.tets(j, 0))).norm());
    if (!(longest > kMinEdge && longest < kMaxEdge)) {
      std::ostringstream sentence;
      sentence << name << " has an edge of length " << longest << ", too "
               << (longest < 1 ? "small" : "large")
               << " to compute with: give the mesh another unit";
      throw Error(Status::mesh, sentence.str());
    }
    // Safety: the rounding error of the volume is up to some 1e-15 of that cube.
    if (!(std::abs(signed_volume(mesh, j)) > 1e-14 * longest * longest * longest))
      throw Error(Status::mesh, name + " has no volume");
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
                       SparseMatrix operator_, const Eigen::VectorXd& weights,
                       const Progress& progress)
    : rest_(mesh.positions),
      region_(checked_region(roles, handle_count)),
      gradient_(std::move(operator_)),
      weighted_(gradient_.transpose() *
                Eigen::VectorXd(weights.transpose().replicate(3, 1).reshaped()).asDiagonal()),
      laplacian_(weighted_ * gradient_),
      factor_(factored(laplacian_, region_, progress)) {}

Positions TetPoisson::solve(const Positions& constrained, const RowMatrix& gradients) const {
  // Solved for the displacement from rest, whose gradients are the given ones minus I: see
  // PoissonSystem.
  Positions displacement = constrained - rest_;
  for (int v : region_.free) displacement.row(v).setZero();
  RowMatrix change = gradients;
  for (Index row = 0; row < change.rows(); ++row) change(row, row % 3) -= 1;
  const RowMatrix right = weighted_ * change - laplacian_ * displacement;
  const RowMatrix rows = factor_.solve(free_rows(right, region_));
  for (int r = 0; r < region_.free_count(); ++r) displacement.row(region_.free[r]) = rows.row(r);
  return rest_ + displacement;
}

RowMatrix TetPoisson::harmonic_weights() const {
  RowMatrix weights = RowMatrix::Zero(rest_.rows(), region_.handle_count);
  if (weights.size() == 0) return weights;  // without columns there is no data to address
  for (size_t v = 0; v < region_.role.size(); ++v)
    if (region_.role[v] >= 0) weights(Index(v), region_.role[v]) = 1;
  const RowMatrix right = -(laplacian_ * weights);
  const RowMatrix rows = factor_.solve(free_rows(right, region_));
  for (int r = 0; r < region_.free_count(); ++r) weights.row(region_.free[r]) = rows.row(r);
  return weights;
}

Positions edit_by_gradients(const TetPoisson& poisson, const TetMesh& mesh,
                            const std::vector<int>& roles, int handle_count,
                            const double* matrices) {
  if (handle_count == 0) return mesh.positions;
  using Affine = Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>;
  std::vector<Eigen::Matrix3d> linear;
  for (int h = 0; h < handle_count; ++h) {
    const Affine matrix(matrices + 12 * static_cast<Index>(h));
    if (!matrix.allFinite())
      throw Error(Status::argument, {Subject::handle, h}, "has a matrix that is not finite",
                  Remedy::call);
    linear.push_back(matrix.leftCols<3>());
  }
  Positions constrained = mesh.positions;
  for (int v = 0; v < mesh.vertex_count(); ++v) {
    if (roles[v] < 0) continue;
    const Affine matrix(matrices + 12 * static_cast<Index>(roles[v]));
    constrained.row(v) =
        (matrix.leftCols<3>() * mesh.positions.row(v).transpose() + matrix.col(3)).transpose();
  }
  const RowMatrix of_vertices = poisson.harmonic_weights();
  RowMatrix weights(mesh.tet_count(), handle_count);
  for (Index j = 0; j < mesh.tet_count(); ++j)
    weights.row(j) = (of_vertices.row(mesh.tets(j, 0)) + of_vertices.row(mesh.tets(j, 1)) +
                      of_vertices.row(mesh.tets(j, 2)) + of_vertices.row(mesh.tets(j, 3))) /
                     4;
  const RowMatrix sums = weights * blend_terms(linear, false);
  RowMatrix gradients(3 * mesh.tet_count(), 3);
  for (Index j = 0; j < mesh.tet_count(); ++j)
    gradients.middleRows<3>(3 * j) = blended(sums.row(j)).transpose();
  const Positions result = poisson.solve(constrained, gradients);
  if (!result.allFinite())
    throw Error(Status::numeric,
                "The handles' matrices are too large: the edited solid is not finite",
                Remedy::move_less);
  return result;
}

}  // namespace dd
