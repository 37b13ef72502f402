// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <optional>

#include "mesh/mesh.h"
#include "systems/operators.h"
#include "systems/poisson_system.h"

namespace dd {

struct CoarseMesh;
struct WholeSurface;

/// A surface with its operators and its factored Poisson system, as all reconstructions need it.
struct FactoredSurface {
  /// mesh: validated, in a box of about unit size, as tolerances assume. region must outlive this.
  /// triangulation: the triangles that carry gradients.
  FactoredSurface(Mesh its_mesh, const Region& its_region,
                  Triangulation triangulation = Triangulation::given, Stiffness its_stiffness = {});

  /// Makes the Poisson system from block, a free_block() of operators.laplacian, and the dissection
  /// unless there is one. Throws UnsolvableSurface.
  void factor(SparseMatrix block, BlockOptions options);

  const RowOrder& order() const { return poisson->order(); }
  /// Of the surface without its stiffness, for K, which would shrink a stiff part's base to a point
  /// (THEORY.md, Stiffness).
  const SurfaceOperators& even_operators() const { return even ? *even : operators; }
  /// The mesh's own triangles with a free corner; without flips these are the active triangles.
  std::vector<int> faces_with_free_corners() const;
  double bytes() const;

  Mesh mesh;                                  ///< S, or a part of it
  std::shared_ptr<const WholeSurface> whole;  ///< where that is a part; else null
  const Region& region;
  Stiffness stiffness;
  std::optional<SurfaceOperators> even;  ///< if the stiffness varies
  SurfaceOperators operators;
  std::optional<Dissection> dissection;  ///< of the free vertices
  /// Whether methods save time and memory by coarse surfaces, for results that differ slightly.
  bool large = false;
  /// Of the active faces, for the usual refinement, if the bind needed it; else null.
  std::shared_ptr<const CoarseMesh> contraction;
  std::unique_ptr<PoissonSystem> poisson;
  Rows rest;  ///< S as rows in order()
  /// √(area of the active triangles): the unit of lengths that are given relative to the surface.
  double active_size = 0;
};

/// n×3 positions as rows of 4 in the given order.
Rows in_order(const Positions& positions, const RowOrder& order);

}  // namespace dd
