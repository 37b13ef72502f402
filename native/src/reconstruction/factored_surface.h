// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <optional>

#include "mesh/mesh.h"
#include "systems/operators.h"
#include "systems/poisson_system.h"

namespace dd {

/// A surface that can be solved for: what every reconstruction works on.
struct FactoredSurface {
  /// mesh: validated, in a box of about unit size, on which tolerances rely. region must outlive
  /// it. triangulation: what gradients are carried by.
  FactoredSurface(Mesh its_mesh, const Region& its_region,
                  Triangulation triangulation = Triangulation::given);

  /// The Poisson system, by block, a free_block() of operators.laplacian; with its dissection where
  /// that is not made yet. Throws UnsolvableSurface.
  void factor(SparseMatrix block, BlockOptions options);

  const RowOrder& order() const { return poisson->order(); }
  /// The mesh's own triangles with a free corner. Where none was flipped they are the active ones.
  std::vector<int> faces_with_free_corners() const;
  double bytes() const;

  Mesh mesh;  ///< S
  const Region& region;
  SurfaceOperators operators;
  std::optional<Dissection> dissection;  ///< of the free vertices
  std::unique_ptr<PoissonSystem> poisson;
  Rows rest;  ///< S as rows in order()
  /// √ of the active triangles' area: the unit of lengths that are told as shares of the surface.
  double active_size = 0;
};

/// n×3 positions as rows of 4 in the given order.
Rows in_order(const Positions& positions, const RowOrder& order);

}  // namespace dd
