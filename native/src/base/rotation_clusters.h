// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "base/bound_surface.h"

namespace dd {

/// Clusters of a surface that share one rotation each, for ReducedEnergy: one around each free
/// handle, in their order, and others of the free surface.
struct RotationClusters {
  std::vector<int> of;  ///< the cluster of each triangle or vertex; -1: none
  int count = 0;
};

/// Of triangles: up to 64 of the free surface, none with a base from outside. free_handles: their
/// numbers.
RotationClusters triangle_clusters(const BoundSurface& bound, const std::vector<int>& free_handles);

/// Of vertices, where limbs are solid: sections of limbs between levels of harmonic functions,
/// and up to 64 of what is no limb. On a symmetric limb they are symmetric. limbs: how far each
/// vertex is part of one, 0 to 1.
RotationClusters vertex_clusters(const BoundSurface& bound, const std::vector<int>& free_handles,
                                 const Eigen::VectorXd& limbs);

}  // namespace dd
