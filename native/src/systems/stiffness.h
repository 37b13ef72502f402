// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <vector>

#include "support/types.h"
#include "systems/region.h"

namespace dd {

/// Of values of vertices, none below 0, those of `count` coarse ones: the largest of the vertices
/// that were merged into each. of_vertex: the coarse vertex of each, or -1.
template <class Vector>
Vector largest_merged(const Vector& values, const std::vector<int>& of_vertex, size_t count) {
  Vector result = Vector::Zero(static_cast<Index>(count));
  for (size_t v = 0; v < of_vertex.size(); ++v)
    if (const int coarse = of_vertex[v]; coarse >= 0)
      result[coarse] = std::max(result[coarse], values[Index(v)]);
  return result;
}

/// How stiff a surface is from place to place: each triangle's ∫‖∇x‖² counts with a factor k_j, its
/// stiffness. So k_j multiplies its cotangents and with them its part of L and div, in all systems
/// but K, while areas and masses stay. The length over which rotations are smoothed grows by √k, so
/// that a stiff part that is shorter gets one rotation.
class Stiffness {
 public:
  /// 1 everywhere.
  Stiffness() = default;
  /// weights: n values from 0, soft, to 1, rigid; or none. The softest free vertex has k = 1.
  Stiffness(const Eigen::VectorXf& weights, const Region& region);

  /// That of a coarse version of the surface, in which vertex v was merged into of_vertex[v] (-1:
  /// none). The stiffest of the merged ones counts, and a triangle is as stiff as its stiffest free
  /// corner: what is interpolated in it must not mix a stiff vertex with soft ones. A triangle of
  /// the surface itself is as stiff as its softest free corner.
  Stiffness of_coarse(const std::vector<int>& of_vertex, const Region& coarse) const;

  bool varies() const { return of_vertex_.size() > 0; }
  /// m factors k_j; empty: 1 everywhere.
  Eigen::VectorXd of_triangles(const Triangles& triangles) const;
  double bytes() const { return static_cast<double>(of_vertex_.size()) * sizeof(double); }

 private:
  /// n, at least 1. 0 for constrained vertices, which are rigid anyway and don't count.
  Eigen::VectorXd of_vertex_;
  bool by_stiffest_corner_ = false;
};

}  // namespace dd
