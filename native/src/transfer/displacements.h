// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "reconstruction/components.h"
#include "solver/sparse_cholesky.h"
#include "systems/region.h"
#include "transfer/place_correction.h"
#include "transfer/source_points.h"
#include "transfer/transfer_context.h"

namespace dd {

/// Beyond the paper, for shapes of one family, such as the heads of a rig whose keys are the same
/// displacements on each. Vertex p_i of the target is displaced as the corresponding point b_i of
/// the source,
///
///   p'_i = p_i + s R (b'_i − b_i).
///
/// R is the placement's rotation. s is its scale if the sizes' ratio is 1.2 or more, and 1 up to a
/// ratio of 1.1, which is a difference of shape; in between it is interpolated. Parts that turn are
/// sheared where the shapes differ, so poses are better transferred by gradients. The corrections
/// of vertices with a point are extended harmonically to those without.
class Displacements : public PlaceCorrection {
 public:
  /// Of the components those that have sources and aren't held are displaced. Throws
  /// UnsolvableSurface.
  explicit Displacements(const TransferContext& context);

  /// The displacement of a point of the target whose source moves from one place to another.
  Eigen::Vector3d displacement(const Eigen::Vector3d& from, const Eigen::Vector3d& to) const {
    return scaled_rotation_ * (to - from);
  }

  /// pose: S'. result: T' by the gradients, in; displaced, out.
  void correct(const Positions& pose, Positions& result) override;

 private:
  const Mesh &source_, &target_;
  const SourcePoints& points_;
  Eigen::Matrix3d scaled_rotation_;  // s R
  ThreadPool& pool_;
  std::vector<int> known_;  // vertices with a point, of components that are displaced
  Region region_;           // free: vertices without a point
  SparseMatrix coupling_;   // rows of L for free vertices, columns for all
  std::unique_ptr<SparseCholesky> factor_;
};

}  // namespace dd
