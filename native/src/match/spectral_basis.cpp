// SPDX-License-Identifier: GPL-3.0-or-later
#include "match/spectral_basis.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>

#include "solver/sparse_cholesky.h"
#include "systems/operators.h"

namespace dd {

namespace {

constexpr int kSubspaceIterations =
    16;  // the last of 30 functions then changes by less than a percent

/// Linear combinations of the columns that are orthonormal with respect to the masses.
RowMatrix orthonormal(const RowMatrix& functions, const Eigen::VectorXd& masses) {
  const Eigen::MatrixXd weighted = masses.asDiagonal() * functions;
  Eigen::MatrixXd products = functions.transpose() * weighted;
  // Safety: the factor exists even where columns depend on each other.
  products.diagonal().array() += 1e-14 * products.trace();
  const Eigen::LLT<Eigen::MatrixXd> factor(products);
  return factor.matrixL().solve(functions.transpose()).transpose();
}

}  // namespace

SpectralBasis spectral_basis(const Mesh& mesh, int count, const std::vector<int>& seeds,
                             ThreadPool* pool) {
  const SurfaceOperators surface =
      surface_operators(mesh.positions, mesh.triangles, Triangulation::delaunay);
  const Eigen::VectorXd masses = surface.masses / surface.masses.sum();
  SparseMatrix shifted = surface.laplacian;
  for (Index v = 0; v < masses.size(); ++v) shifted.coeffRef(v, v) += masses[v];
  FactorOptions options;
  options.pool = pool;
  const SparseCholesky factor(shifted, options);

  // M f for impulses f of unit integral.
  RowMatrix right = RowMatrix::Zero(mesh.vertex_count(), static_cast<Index>(seeds.size()));
  for (size_t i = 0; i < seeds.size(); ++i) right(seeds[i], static_cast<Index>(i)) = 1;
  SpectralBasis basis;
  for (int round = 0; round < kSubspaceIterations; ++round) {
    const RowMatrix functions = orthonormal(orthonormal(factor.solve(right, pool), masses), masses);
    const RowMatrix applied = surface.laplacian * functions;
    const Eigen::MatrixXd energies = functions.transpose() * applied;
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> ritz(energies);
    const RowMatrix best = functions * ritz.eigenvectors();
    right = masses.asDiagonal() * best;
    if (round + 1 < kSubspaceIterations) continue;
    basis.values = ritz.eigenvalues().head(count);
    basis.functions = best.leftCols(count);
  }
  return basis;
}

}  // namespace dd
