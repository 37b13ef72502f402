// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mesh/mesh.h"
#include "support/thread_pool.h"

namespace dd {

/// The first eigenfunctions of a surface's Laplacian, L φ = λ M φ. They are intrinsic, so a pose
/// changes them little.
struct SpectralBasis {
  Eigen::VectorXd values;  ///< λ, ascending, of the surface scaled to an area of 1
  RowMatrix functions;     ///< n×k, orthonormal with respect to masses that sum to 1
};

/// By inverse subspace iteration (Bathe 2013) with L + M, from an impulse at each seed. seeds:
/// spread over the surface, and more than count, so that the last functions converge.
SpectralBasis spectral_basis(const Mesh& mesh, int count, const std::vector<int>& seeds,
                             ThreadPool* pool);

}  // namespace dd
