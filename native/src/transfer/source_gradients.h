// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <utility>
#include <vector>

#include "mesh/correspondence.h"
#include "mesh/mesh.h"
#include "mesh/topology.h"
#include "reconstruction/gradients.h"
#include "support/similarity.h"
#include "support/thread_pool.h"

namespace dd {

/// The weight of a triangle among those that are as good as at rest, or in a motion.
inline double stillness(const Eigen::Matrix3d& gradient, const Eigen::Matrix3d& motion) {
  constexpr double kStill = 1e-2;
  return 1 / (kStill * kStill + (gradient - motion).squaredNorm());
}

/// The deformation gradients S_j (15) of a source mesh as a target's triangles take them: for each
/// triangle of the target the mean of those of its sources, F S Fᵀ with the rotation and reflection
/// F by which the meshes lie to each other. Target triangles without a source go with the nearest
/// that has one across shared edges, or else vertices.
///
/// Where a source triangle gives its gradient to far more area than its own, for how large its part
/// is on the target or is placed there, whichever is larger, the mean over so many triangles about
/// it stands in for it: what a sliver does is no news about a whole region.
class SourceGradients {
 public:
  /// placement takes the source onto the target. source must outlive this. Throws Error(argument)
  /// when nothing corresponds.
  SourceGradients(const Mesh& source, const Mesh& target, const Correspondence& correspondence,
                  const Similarity& placement);

  /// Takes a pose S', in the source's units. rotation_only: S_j reduced to its rotation.
  void take(const Positions& pose, bool rotation_only, ThreadPool& pool);

  /// S_j of a target triangle in the pose taken.
  const Eigen::Matrix3d& at(int target_triangle) const { return gradients_[target_triangle]; }

  /// The mean of some triangles', zero of none.
  Eigen::Matrix3d mean_of(const Fans::Range& target_triangles) const;

  /// Whether a target triangle has sources of its own.
  bool is_matched(int target_triangle) const { return matched_[target_triangle]; }
  /// Target triangles that have none, and one of them; -1: none.
  int unmatched_count() const { return unmatched_count_; }
  int unmatched_example() const { return unmatched_example_; }

  /// Triangles of the source that gave theirs to too much, and the one that did most; -1: none.
  int overstretched_count() const { return static_cast<int>(means_.size()); }
  int overstretched_example() const { return overstretched_example_; }

  /// Of a matched triangle, as a triangle of the source.
  int first_source(int target_triangle) const { return used_[sources_[begin_[target_triangle]]]; }
  /// Whether each triangle has the source of its own number, and no other.
  bool is_one_to_one() const;
  /// Mean centre of a matched triangle's sources, at these places of the source's vertices.
  Eigen::Vector3d centre_of_sources(const Positions& places, int target_triangle) const;

 private:
  void match(const Mesh& target, const Correspondence& correspondence);
  void find_overstretched(const Mesh& target);
  void take_means(bool rotation_only);
  int numbered(int source_triangle);
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
  std::vector<int> number_;  // of every triangle of the source
  StandIns stand_ins_;       // of every triangle of the source
  std::vector<int> used_;
  std::vector<Eigen::Matrix3d> rest_inverse_;  // [e1 e2 n]⁻¹ (15) of what stands in for them
  std::vector<RotationBlock<double>> rotation_blocks_;
  std::vector<Eigen::Matrix3d> used_gradients_;
  Rows source_rows_, quaternions_;

  struct Mean {
    int of;
    std::vector<std::pair<int, double>> shares;  // they sum to 1
  };
  std::vector<Mean> means_;
  int overstretched_example_ = -1;

  std::vector<Eigen::Matrix3d> gradients_;  // of each target triangle
};

}  // namespace dd
