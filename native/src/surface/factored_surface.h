// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "mesh/mesh.h"
#include "systems/operators.h"
#include "systems/poisson_system.h"

namespace dd {

/// A surface that can be solved for: what every reconstruction works on.
struct FactoredSurface {
  /// mesh: validated, in a box of about unit size, on which tolerances rely. region must outlive
  /// it.
  FactoredSurface(Mesh its_mesh, const Region& its_region);

  /// The Poisson system, by a free_block() of operators.laplacian. Throws UnsolvableSurface.
  void factor(SparseMatrix block, const BlockOptions& options);

  const RowOrder& order() const { return poisson->order(); }
  double bytes() const;

  Mesh mesh;  ///< S
  const Region& region;
  SurfaceOperators operators;
  std::unique_ptr<PoissonSystem> poisson;
  Rows rest;  ///< S as rows in order()
};

/// n×3 positions as rows of 4 in the given order.
Rows in_order(const Positions& positions, const RowOrder& order);

}  // namespace dd
