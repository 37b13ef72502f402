// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mesh/mesh.h"

namespace dd {

/// Lengths and angles of each triangle: all that the cotangent Laplacian and the masses need.
///
/// A triangle without area has infinite cotangents. One that is thinner than 1 : 1000 is taken with
/// its third corner lifted to that height over its longest edge (an intrinsic change in the manner
/// of Sharp and Crane 2020, but of that triangle alone, so that all others stay exact) and counted.
/// The bi-Laplacian grows with the cube of the thinness: 1 : 1e6 as for a Laplacian alone would
/// leave it no digits.
struct TriangleMetric {
  CornerValues cotangents;      ///< m×3, of the angle at each corner
  Eigen::VectorXd areas;        ///< m
  std::vector<int> degenerate;  ///< triangles thinner than 1 : 1000, as the mesh has them
};
TriangleMetric triangle_metric(const Positions& positions, const Triangles& triangles);

/// Cotangent Laplacian L = GᵀDG (4), (5): n×n, positive semi-definite, rows sum to zero,
/// scale-free.
SparseMatrix cotangent_laplacian(const TriangleMetric& metric, const Triangles& triangles, int n);

/// Lumped masses: mixed Voronoi areas (Meyer et al. 2003), n values that sum to the surface's area.
/// A vertex whose triangles are all (nearly) without area, or that has none, gets 1e-8 of the mean.
Eigen::VectorXd mixed_voronoi_masses(const TriangleMetric& metric, const Triangles& triangles,
                                     int n);

/// Which triangles a surface is measured by. The values are those of dd_triangulation in the public
/// header.
enum class Triangulation {
  delaunay = 0,  ///< intrinsic ones, without obtuse edges: see intrinsic_delaunay()
  given = 1      ///< the mesh's own
};

/// What every method needs of one geometry, made once.
struct SurfaceOperators {
  /// m×3: what metric and L are made of, and gradients are taken on. The mesh's own, or as many
  /// others of the same vertices, in the same places where they are the mesh's own.
  Triangles triangles;
  bool flipped = false;  ///< whether any is another
  TriangleMetric metric;
  SparseMatrix laplacian;
  Eigen::VectorXd masses;
};
SurfaceOperators surface_operators(const Positions& positions, const Triangles& triangles,
                                   Triangulation triangulation = Triangulation::given);

/// Gradient operator G (3), 3m×n: rows 3j..3j+2 hold (∇φ₁, ∇φ₂, ∇φ₃) of triangle j as in (13).
SparseMatrix gradient(const Positions& positions, const Triangles& triangles);

/// Divergence GᵀD (4), n×3m, D the triangle areas, each three times.
SparseMatrix divergence(const SparseMatrix& gradient, const TriangleMetric& metric);

/// Divergence of each triangle's own position gradient, div(G_j) by corner: row 3j+k is
/// area_j (∇φ_k)ᵀ G_j, a vector in the triangle's plane, so that div(G_j S_jᵀ) at corner k is S_j
/// times it. 3m×3, from the metric alone: exact for S_j = const even where the triangle is
/// degenerate or an intrinsic one, and for all others equal to area_j ∇φ_k, the paper's div(S_jᵀ)
/// (§5, both right-hand sides lead to the same result).
Positions corner_divergence(const TriangleMetric& metric, const Positions& positions,
                            const Triangles& triangles);

/// Mean length of the triangles' edges.
double mean_edge_length(const Positions& positions, const Triangles& triangles);

}  // namespace dd
