// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "reconstruction/components.h"
#include "solver/sparse_cholesky.h"
#include "systems/region.h"
#include "transfer/place_correction.h"
#include "transfer/source_points.h"

namespace dd {

/// Beyond the paper, for shapes of one family, as the heads of a rig whose keys are the same
/// displacements on each: vertex p_i of the target goes as far as the point b_i of the source that
/// it corresponds to, in the direction in which that lies on the target,
///
///   p'_i = p_i + s R (b'_i − b_i),
///
/// R the placement's rotation, s its scale or, where that is within a tenth of 1, 1: so much is a
/// difference of shape, and from a fifth on it counts wholly. What turns as a whole is sheared
/// where the shapes differ: poses are better followed by gradients. Vertices without a point go
/// with those around them, what they lack to where they belong spread harmonically.
class Displacements : public PlaceCorrection {
 public:
  /// components: of the target; those with sources that nothing holds go. All must outlive this.
  /// Throws UnsolvableSurface.
  Displacements(const Mesh& source, const Mesh& target, const std::vector<Component>& components,
                const SourcePoints& points, const Similarity& placement, ThreadPool& pool);

  /// Where its source's way from one place to another takes a point of the target.
  Eigen::Vector3d way(const Eigen::Vector3d& from, const Eigen::Vector3d& to) const {
    return turn_ * (to - from);
  }

  /// pose: S'. result: T' as gradients make it; moved.
  void correct(const Positions& pose, Positions& result) override;

 private:
  const Mesh &source_, &target_;
  const SourcePoints& points_;
  Eigen::Matrix3d turn_;  // s R
  ThreadPool& pool_;
  std::vector<int> known_;  // vertices of such components with a point
  Region region_;           // free: those without
  SparseMatrix coupling_;   // L of these and all
  std::unique_ptr<SparseCholesky> factor_;
};

}  // namespace dd
