// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "mesh/mesh.h"
#include "mesh/topology.h"
#include "support/thread_pool.h"

namespace dd {

/// A deforming surface with its triangles' planes and areas, in the pose set last; at first at
/// rest.
class PosedSurface {
 public:
  PosedSurface(Mesh at_rest, ThreadPool& pool);

  void set_pose(const Positions& posed, ThreadPool& pool);

  const Mesh& mesh() const { return mesh_; }
  /// The triangles around a vertex.
  VertexTriangles::Range fan(int vertex) const { return fans_.of(vertex); }

  /// The normal of triangle j, zero where it has no area.
  Eigen::RowVector3d normal(int j) const { return planes_.row(j).head<3>(); }
  /// The signed height of a place over the plane of triangle j.
  double height(int j, const Eigen::Vector3d& position) const {
    return planes_.row(j).head<3>().dot(position) + planes_(j, 3);
  }
  /// Twice the area of each triangle.
  const Eigen::VectorXd& doubled_areas() const { return doubled_areas_; }

  /// Sums over triangles; areas are doubled.
  struct Patch {
    Eigen::RowVector3d normal = Eigen::RowVector3d::Zero();  ///< Σ 2 A n
    double area = 0;                                         ///< Σ 2 A
  };
  template <class Range>
  Patch patch(const Range& triangles) const {
    Patch sum;
    for (int j : triangles) {
      sum.normal += doubled_areas_[j] * normal(j);
      sum.area += doubled_areas_[j];
    }
    return sum;
  }

 private:
  Mesh mesh_;
  VertexTriangles fans_;
  Rows planes_;  // of each triangle: n and −nᵀ a
  Eigen::VectorXd doubled_areas_;
};

}  // namespace dd
