// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mesh/correspondence.h"
#include "mesh/mesh.h"
#include "support/similarity.h"
#include "support/thread_pool.h"
#include "surface/gradients.h"

namespace dd {

/// The deformation gradients S_j (15) of a source mesh as a target's triangles take them: for each
/// triangle of the target the mean of those of its sources, turned as the meshes lie to each other.
/// Target triangles without a source go with the nearest that has one across shared edges, or else
/// vertices.
class SourceGradients {
 public:
  /// placement takes the source onto the target. source must outlive this. Throws Error(argument)
  /// when nothing corresponds.
  SourceGradients(const Mesh& source, const Triangles& target, int target_vertex_count,
                  const Correspondence& correspondence, const Similarity& placement);

  /// Takes a pose S', in the source's units. rotation_only: S_j reduced to its rotation.
  void take(const Positions& pose, bool rotation_only, ThreadPool& pool);

  /// S_j of a target triangle in the pose taken.
  const Eigen::Matrix3d& at(int target_triangle) const { return gradients_[target_triangle]; }

  /// Whether a target triangle has sources of its own.
  bool is_matched(int target_triangle) const { return matched_[target_triangle]; }
  /// Target triangles that have none, and one of them; -1: none.
  int unmatched_count() const { return unmatched_count_; }
  int unmatched_example() const { return unmatched_example_; }

  /// Mean centre of a matched triangle's sources, at these places of the source's vertices.
  Eigen::Vector3d centre_of_sources(const Positions& places, int target_triangle) const;

 private:
  void match(const Triangles& target, int target_vertex_count,
             const Correspondence& correspondence);
  void prepare();
  /// Rotations of used triangles that a pose leaves without area, which has none: their
  /// neighbours'.
  void replace_collapsed(const Positions& pose);
  void turn_onto_target(const Positions& pose, bool rotation_only, ThreadPool& pool);
  Eigen::Matrix3d mean(int target_triangle, bool rotation_only) const;

  const Mesh& source_;
  Similarity placement_;

  // Of each target triangle where its sources are in sources_; as of Correspondence, none empty but
  // where a whole component has none.
  std::vector<int> begin_, end_, sources_;
  std::vector<char> matched_;
  int unmatched_count_ = 0, unmatched_example_ = -1;

  // The triangles of the source that are asked for, numbered anew.
  StandIns stand_ins_;  // of every triangle of the source
  std::vector<int> used_;
  std::vector<Eigen::Matrix3d> rest_inverse_;  // [e1 e2 n]⁻¹ (15) of what stands in for them
  std::vector<RotationBlock<double>> rotation_blocks_;
  std::vector<Eigen::Matrix3d> used_gradients_;
  Rows source_rows_, quaternions_;

  std::vector<Eigen::Matrix3d> gradients_;  // of each target triangle
};

}  // namespace dd
