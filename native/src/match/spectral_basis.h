// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mesh/mesh.h"
#include "support/thread_pool.h"

namespace dd {

/// The smoothest functions on a surface: the first eigenfunctions of its Laplacian, L φ = λ M φ.
/// They know the surface's own distances alone, so a pose changes them little.
struct SpectralBasis {
  Eigen::VectorXd values;  ///< λ, ascending, of the surface scaled to an area of 1
  RowMatrix functions;     ///< n×k, orthonormal by masses that sum to 1
};

/// By subspace iteration (Bathe 2013) on the inverse of L + M, from a point source at each of some
/// vertices. seeds: vertices apart, some more than count.
SpectralBasis spectral_basis(const Mesh& mesh, int count, const std::vector<int>& seeds,
                             ThreadPool* pool);

}  // namespace dd
