// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "reconstruction/gradients.h"

namespace dd {

/// Computes div(R_jᵀ) of (14) from rotations of vertices, block by block; R_j is the mean of the
/// triangle's corners.
template <class Real>
class RotatedFluxPass {
 public:
  /// of: n×3, the positions whose gradients are rotated. corner_of(vertex): its row of the
  /// quaternions.
  template <class CornerOf>
  RotatedFluxPass(const FactoredSurface& surface, const Positions& of, const CornerOf& corner_of)
      : surface_(surface),
        layout_(surface.poisson->active()),
        blocks_(rotated_flux_blocks<Real>(surface, layout_, of, corner_of)) {}

  /// Replaces the positions whose gradients are rotated: rows in the surface's order.
  void take(const Rows& positions) {
    const std::vector<int>& row = surface_.order().row_of_vertex;
    Positions of(positions.rows(), 3);
    for (Index v = 0; v < of.rows(); ++v) of.row(v) = positions.row(row[size_t(v)]).head<3>();
    take_flux(surface_, layout_, of, blocks_);
  }

  /// As the add of PoissonSystem::solve(). quaternions: rows of 4.
  void add(const Real* quaternions, int section, double* rows) const {
    const int begin = layout_.begin[section];
    kernels().of<Real>().rotated_flux_pass(layout_.begin[section + 1] - begin,
                                           blocks_.data() + begin, quaternions, rows);
  }

  /// The sum of add() over all sections.
  Rows all(const Real* quaternions) const {
    Rows rows = Rows::Zero(surface_.poisson->right_hand_side_rows(), 4);
    for (int section = 0; section < layout_.sections(); ++section)
      add(quaternions, section, rows.data());
    return rows;
  }

  double bytes() const {
    return static_cast<double>(blocks_.size() * sizeof(RotatedFluxBlock<Real>));
  }

 private:
  const FactoredSurface& surface_;
  ActiveBlocks layout_;
  std::vector<RotatedFluxBlock<Real>> blocks_;
};

}  // namespace dd
