// SPDX-License-Identifier: GPL-3.0-or-later
#include "smooth_arap_peer.h"

#include <Eigen/SparseCholesky>
#include <stdexcept>

#include "support/rotations.h"
#include "systems/free_block.h"
#include "systems/operators.h"
#include "timing.h"

namespace dd::bench {

namespace {

using Rotations = std::vector<Eigen::Matrix3d>;

class Energy {
 public:
  Energy(const Mesh& mesh, double lambda)
      : mesh_(mesh),
        lambda_(lambda),
        operators_(surface_operators(mesh.positions, mesh.triangles)),
        corners_(corner_divergence(operators_.metric, mesh.positions, mesh.triangles)),
        per_mass_(operators_.masses.mean() * operators_.masses.cwiseInverse()),
        differential_(operators_.laplacian * mesh.positions) {}

  SparseMatrix matrix() const {
    const SparseMatrix& L = operators_.laplacian;
    const SparseMatrix scaled = per_mass_.asDiagonal() * L;
    return (1 - lambda_) * L + lambda_ * SparseMatrix(L * scaled);
  }

  /// The rotation of each vertex nearest to the gradients around it.
  Rotations rotations(const Positions& present) const {
    Rotations sums(size_t(mesh_.vertex_count()), Eigen::Matrix3d::Zero());
    for (Index j = 0; j < mesh_.triangle_count(); ++j) {
      Eigen::Matrix3d gradient = Eigen::Matrix3d::Zero();  // times the area
      for (int k = 0; k < 3; ++k)
        gradient += present.row(mesh_.triangles(j, k)).transpose() * corners_.row(3 * j + k);
      for (int k = 0; k < 3; ++k) sums[size_t(mesh_.triangles(j, k))] += gradient;
    }
    for (Eigen::Matrix3d& R : sums) R = polar_rotation(R);
    return sums;
  }

  Positions right_hand_side(const Rotations& R) const {
    Positions first = Positions::Zero(mesh_.vertex_count(), 3), second = differential_;
    for (Index j = 0; j < mesh_.triangle_count(); ++j) {
      const auto corner = mesh_.triangles.row(j);
      const Eigen::Matrix3d mean =
          (R[size_t(corner[0])] + R[size_t(corner[1])] + R[size_t(corner[2])]) / 3;
      for (int k = 0; k < 3; ++k)
        first.row(corner[k]) += corners_.row(3 * j + k) * mean.transpose();
    }
    for (Index v = 0; v < second.rows(); ++v)
      second.row(v) = per_mass_[v] * differential_.row(v) * R[size_t(v)].transpose();
    return (1 - lambda_) * first + lambda_ * (operators_.laplacian * second);
  }

 private:
  const Mesh& mesh_;
  double lambda_;
  SurfaceOperators operators_;
  Positions corners_;
  Eigen::VectorXd per_mass_;  // with masses whose mean is 1
  Positions differential_;    // L p
};

double size_of(const Positions& p) { return (p.rowwise() - p.colwise().mean()).norm(); }

}  // namespace

SmoothArapResult deform_with_smooth_arap(const Mesh& mesh, const std::vector<int>& roles,
                                         const test::Affine& motion, const SmoothArap& settings) {
  SmoothArapResult result;
  const auto prepare = Clock::now();
  const Region region = make_region(mesh, roles, 1);
  const Energy energy(mesh, settings.lambda);
  const SparseMatrix matrix = energy.matrix();
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor(free_block(matrix, region));
  if (factor.info() != Eigen::Success) throw std::runtime_error("Smooth ARAP: no factor");
  result.preparing_ms = milliseconds_since(prepare);

  const auto move = Clock::now();
  Positions held = Positions::Zero(mesh.vertex_count(), 3);
  for (size_t v = 0; v < roles.size(); ++v) {
    if (roles[v] == kFree) continue;
    const Index row = Index(v);
    held.row(row) = mesh.positions.row(row);
    if (roles[v] >= 0) held.row(row) = test::transformed(motion, mesh.positions.row(row));
  }
  const Positions pull = matrix * held;
  Positions present = mesh.positions;  // at rest, where all rotations are I
  const double small = settings.small * size_of(mesh.positions);
  while (!result.converged && result.iterations < settings.most_iterations) {
    const Positions right = energy.right_hand_side(energy.rotations(present)) - pull;
    const Eigen::MatrixXd solved = factor.solve(free_rows(right, region));
    Positions next = held;
    for (size_t i = 0; i < region.free.size(); ++i) next.row(region.free[i]) = solved.row(Index(i));
    result.converged = (next - present).norm() < small;
    present = next;
    ++result.iterations;
  }
  result.moving_ms = milliseconds_since(move);
  result.deformed = present;
  return result;
}

}  // namespace dd::bench
