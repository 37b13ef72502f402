// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mesh/mesh.h"
#include "systems/stiffness.h"

namespace dd {

/// Cotangents and areas of triangles: all that the cotangent Laplacian and the masses need.
///
/// A triangle without area has infinite cotangents. So a triangle whose height is below 1e-3 of its
/// longest edge is measured with that height instead and listed as degenerate: an intrinsic
/// mollification (Sharp and Crane 2020) of that triangle alone, which leaves all others exact.
/// Entries of the bi-Laplacian grow with the cube of longest edge / height: a limit of 1e-6, enough
/// for the Laplacian alone, would leave them no significant digits.
struct TriangleMetric {
  CornerValues cotangents;      ///< m×3, of the angle at each corner
  Eigen::VectorXd areas;        ///< m
  std::vector<int> degenerate;  ///< triangles thinner than 1 : 1000, before any flip
};
TriangleMetric triangle_metric(const Positions& positions, const Triangles& triangles);

/// Cotangent Laplacian L = GᵀDG (4), (5): n×n, positive semi-definite, rows sum to zero,
/// scale-free.
SparseMatrix cotangent_laplacian(const TriangleMetric& metric, const Triangles& triangles, int n);

/// Lumped masses: mixed Voronoi areas (Meyer et al. 2003), n values that sum to the surface's area.
/// Each is at least 1e-8 of the mean mass, so that M⁻¹ exists at vertices without a triangle or
/// with degenerate ones only.
Eigen::VectorXd mixed_voronoi_masses(const TriangleMetric& metric, const Triangles& triangles,
                                     int n);

/// The triangles on which operators and gradients are built. The values are those of
/// dd_triangulation in the public header.
enum class Triangulation {
  delaunay = 0,  ///< intrinsic Delaunay triangles: see intrinsic_delaunay()
  given = 1      ///< the mesh's own
};

/// The discrete operators of one geometry, which all methods share.
struct SurfaceOperators {
  /// m×3: the triangles of metric, laplacian and deformation gradients: the mesh's own, or
  /// intrinsic ones over the same vertices. A triangle that no flip changed keeps its index.
  Triangles triangles;
  bool flipped = false;       ///< whether any edge was flipped
  TriangleMetric metric;      ///< cotangents times the stiffness
  Eigen::VectorXd stiffness;  ///< m, of the triangles; empty: 1 everywhere
  SparseMatrix laplacian;
  Eigen::VectorXd masses;
};
SurfaceOperators surface_operators(const Positions& positions, const Triangles& triangles,
                                   Triangulation triangulation = Triangulation::given);
/// The same of a surface of this stiffness. even: without any.
SurfaceOperators stiffened(const SurfaceOperators& even, const Stiffness& stiffness);

/// Gradient operator G (3), 3m×n: rows 3j..3j+2 hold (∇φ₁, ∇φ₂, ∇φ₃) of triangle j as in (13).
SparseMatrix gradient(const Positions& positions, const Triangles& triangles);

/// Divergence GᵀD (4), n×3m, D the triangle areas, each three times.
SparseMatrix divergence(const SparseMatrix& gradient, const TriangleMetric& metric);

/// Corner fluxes, 3m×3: row 3j+k is area_j (∇φ_k)ᵀ G_j, the part of div(G_j) at corner k, G_j the
/// position gradient of triangle j: a vector in the triangle's plane. So div(G_j S_jᵀ) at corner k
/// is S_j times it. It is made of ½ cot times edges: exact for S_j = const even where the triangle
/// is degenerate or intrinsic, and for all others equal to area_j ∇φ_k, the paper's div(S_jᵀ) (§5:
/// both right-hand sides lead to the same result).
Positions corner_divergence(const TriangleMetric& metric, const Positions& positions,
                            const Triangles& triangles);

/// The same at corner k of one triangle, by its cotangents and its corners' positions, a column
/// each.
template <class Cotangents>
Eigen::Vector3d corner_divergence(const Cotangents& cotangents, const Eigen::Matrix3d& corners,
                                  int k) {
  const int next = (k + 1) % 3, last = (k + 2) % 3;
  return 0.5 * (cotangents[last] * (corners.col(k) - corners.col(next)) +
                cotangents[next] * (corners.col(k) - corners.col(last)));
}

/// The same at all corners of triangle j, a column each.
inline Eigen::Matrix3d corner_divergences(const TriangleMetric& metric, const Positions& positions,
                                          const Triangles& triangles, Index j) {
  Eigen::Matrix3d corners, result;
  for (int k = 0; k < 3; ++k) corners.col(k) = positions.row(triangles(j, k)).transpose();
  for (int k = 0; k < 3; ++k)
    result.col(k) = corner_divergence(metric.cotangents.row(j), corners, k);
  return result;
}

/// Mean edge length over all triangles, an edge counted once for each of its triangles.
double mean_edge_length(const Positions& positions, const Triangles& triangles);

}  // namespace dd
