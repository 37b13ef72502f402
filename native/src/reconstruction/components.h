// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mesh/mesh.h"
#include "systems/region.h"

namespace dd {

/// A connected component of the surface. Deformation gradients leave its translation open unless it
/// is held.
struct Component {
  std::vector<int> vertices;   ///< except fixed ones
  std::vector<int> triangles;  ///< all
  bool held = false;           ///< whether it has a fixed or handle vertex
};

/// The components with a vertex that isn't fixed, sorted by the lowest such vertex.
std::vector<Component> movable_components(const Mesh& mesh, const Region& region);

/// A weighted mean of shifts.
struct MeanShift {
  Eigen::RowVector3d sum = Eigen::RowVector3d::Zero();
  double weight = 0;

  void add(double w, const Eigen::RowVector3d& shift) {
    sum += w * shift;
    weight += w;
  }
  void add(const MeanShift& other) {
    sum += other.sum;
    weight += other.weight;
  }
  /// The mean, or zero where the weights sum to zero.
  Eigen::RowVector3d mean() const {
    return weight > 0 ? Eigen::RowVector3d(sum / weight) : Eigen::RowVector3d::Zero();
  }
};

}  // namespace dd
