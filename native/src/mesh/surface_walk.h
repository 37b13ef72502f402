// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mesh/aabb_tree.h"
#include "mesh/topology.h"

namespace dd {

/// Nearest points found locally: a walk over the surface from triangle to adjacent triangle that
/// goes on while the distance to the query point falls. It stops at a local minimum, so that of two
/// sheets close to each other it stays on the one where it began.
class SurfaceWalk {
 public:
  /// mesh must outlive this.
  explicit SurfaceWalk(const Mesh& mesh);

  /// The point reached from triangle `from`.
  PointOnTriangle to(const Eigen::Vector3d& point, int from) const;

 private:
  const Mesh& mesh_;
  Edges edges_;
  std::vector<int> of_half_edges_;
};

}  // namespace dd
