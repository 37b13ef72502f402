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

/// The weight of a triangle in a mean over those that deform least, relative to a motion.
inline double stillness(const Eigen::Matrix3d& gradient, const Eigen::Matrix3d& motion) {
  // Deviation ‖S − M‖ at which the weight is half of the largest one: less counts as none.
  constexpr double kStill = 1e-2;
  return 1 / (kStill * kStill + (gradient - motion).squaredNorm());
}

/// The deformation gradients S_j (15) of a source mesh, for a target's triangles. Each target
/// triangle has the mean of F S Fᵀ over its sources, F the placement's rotation and reflection. One
/// without a source takes the gradient of the nearest that has one, across shared edges or else
/// vertices.
///
/// Where a source triangle serves far more area of the target than its own, its gradient is
/// replaced by the mean over as much area around it, up to 64 triangles: a sliver's gradient
/// doesn't represent a region. Areas are compared relative to the scale of the triangle's loose
/// part, or of the placement if that is larger.
class SourceGradients {
 public:
  /// placement takes the source onto the target. source must outlive this. Throws Error(argument)
  /// when nothing corresponds.
  SourceGradients(const Mesh& source, const Mesh& target, const Correspondence& correspondence,
                  const Similarity& placement);

  /// Computes the gradients of a pose S', in the source's units. rotation_only: reduced to
  /// rotations.
  void set_pose(const Positions& pose, bool rotation_only, ThreadPool& pool);

  /// S_j of a target triangle in the pose.
  const Eigen::Matrix3d& at(int target_triangle) const { return gradients_[target_triangle]; }

  /// The mean gradient of some target triangles, zero if there are none.
  Eigen::Matrix3d mean_of(const VertexTriangles::Range& target_triangles) const;

  /// Whether a target triangle has sources of its own.
  bool is_matched(int target_triangle) const { return matched_[target_triangle]; }
  /// The number of target triangles without a source, and the first of them; -1: none.
  int unmatched_count() const { return unmatched_count_; }
  int unmatched_example() const { return unmatched_example_; }

  /// The number of source triangles that are replaced by means, and that of the largest ratio of
  /// areas; -1: none.
  int overstretched_count() const { return static_cast<int>(means_.size()); }
  int overstretched_example() const { return overstretched_example_; }

  /// The first source of a matched triangle, as a triangle of the source mesh.
  int first_source(int target_triangle) const { return active_[sources_[begin_[target_triangle]]]; }
  /// Whether each target triangle has the source triangle of the same number alone.
  bool is_one_to_one() const;
  /// The mean centre of a matched triangle's sources. positions: of the source's vertices.
  Eigen::Vector3d centre_of_sources(const Positions& positions, int target_triangle) const;

 private:
  void record_sources(const Mesh& target, const Correspondence& correspondence);
  void find_overstretched(const Mesh& target);
  void apply_means(bool rotation_only);
  int active_index_of(int source_triangle);
  void prepare();
  /// Gives used triangles that a pose leaves without area the rotation of their nearest neighbour
  /// with one.
  void replace_collapsed(const Positions& pose);
  void rotate_onto_target(const Positions& pose, bool rotation_only, ThreadPool& pool);
  Eigen::Matrix3d mean(int target_triangle, bool rotation_only) const;

  const Mesh& source_;
  Similarity placement_;

  // The sources of target triangle j are sources_[begin_[j]] to sources_[end_[j] − 1], as indices
  // into active_. Empty only if none in its whole component has a source.
  std::vector<int> begin_, end_, sources_;
  std::vector<char> matched_;
  int unmatched_count_ = 0, unmatched_example_ = -1;

  // The source's triangles that serve the target, renumbered.
  std::vector<int> active_index_;  // index in active_ of every triangle of the source; -1: not used
  StandIns stand_ins_;             // of every triangle of the source
  std::vector<int> active_;
  std::vector<Eigen::Matrix3d> rest_inverse_;  // [e1 e2 n]⁻¹ (15) of their stand-ins
  std::vector<RotationBlock<double>> rotation_blocks_;
  std::vector<Eigen::Matrix3d> active_gradients_;
  Rows source_rows_, quaternions_;

  struct AreaMean {
    int of;
    std::vector<std::pair<int, double>> shares;  // they sum to 1
  };
  std::vector<AreaMean> means_;
  int overstretched_example_ = -1;

  std::vector<Eigen::Matrix3d> gradients_;  // of each target triangle
};

}  // namespace dd
