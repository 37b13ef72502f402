// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "meshes.h"
#include "peer_result.h"

namespace dd::bench {

/// The settings of the published program.
struct SmoothArap {
  double lambda = 0.99;
  int most_iterations = 2000;
  double small = 1e-4;  ///< ends after a step below this fraction of the vertices' norm
};

struct SmoothArapResult : PeerResult {
  int iterations = 0;
  bool converged = false;
};

/// Smooth ARAP (Oehri, Herholz and Sorkine-Hornung 2025), an implementation of our own for
/// comparisons, on Eigen's sparse solver, with handle 0 moved. It minimizes
///
///   (1 − λ) Σ_j area_j Σ_{i ∈ j} ‖S_j − R_i‖² / 3  +  λ Σ_i ‖(L p')_i − R_i (L p)_i‖² / m_i
///
/// in two alternating steps. R_i, of each vertex, is the rotation nearest to Σ_j area_j S_j over
/// the triangles j around it, S_j the gradients within the triangles' planes. Then, with one factor
/// for all iterations,
///
///   ((1 − λ) L + λ L M⁻¹ L) p' = (1 − λ) div(R_j) + λ L M⁻¹ (R_i (L p)_i),
///
/// R_j the mean of the triangle's three. It starts from R_i = I, so that the first p' is that of
/// linear Laplacian editing.
///
/// Found in the published program (github.com/oehria/smooth-arap): the two terms; that rotations
/// are fitted to edges alone, by spokes and rims, a third of each edge to each corner of its
/// triangles, which is the sum above; M mixed Voronoi areas scaled to a mean of 1, so that λ = .99
/// stands for a length of about 10 edges whatever these measure, and for half of it on a mesh of 4
/// times the triangles; .99, with which its interactive version starts; for the survey's meshes at
/// most 2000 iterations, until one moves vertices by less than 1e-4 of their norm.
///
/// Not the same: that norm is taken from the vertices' mean and not from the origin, so that the
/// end of the iteration doesn't depend on the place; triangles thinner than 1 : 1000 are taken as
/// in TriangleMetric. Not known: which λ, and which of its three starts (rest, which is the one
/// here, a Poisson system, a bi-Laplacian one), made the pictures of the paper.
SmoothArapResult deform_with_smooth_arap(const Mesh& mesh, const std::vector<int>& roles,
                                         const test::Affine& motion,
                                         const SmoothArap& settings = {});

}  // namespace dd::bench
