// SPDX-License-Identifier: GPL-3.0-or-later
#include "support/handle_blend.h"

#include "support/rotations.h"

namespace dd {

HandleBlend::HandleBlend(const std::vector<Eigen::Matrix3d>& linear, const RowMatrix& weights,
                         bool rotation_only) {
  const Index count = static_cast<Index>(linear.size());
  RowMatrix turns(count, 3), stretches(count, 9);
  for (Index h = 0; h < count; ++h) {
    const Eigen::Matrix3d& A = linear[static_cast<size_t>(h)];
    const Eigen::Matrix3d R = polar_rotation(A);
    turns.row(h) = rotation_vector(R).transpose();
    const Eigen::Matrix3d change = R.transpose() * A - Eigen::Matrix3d::Identity();
    stretches.row(h) = change.reshaped().transpose();
  }
  turns_ = weights * turns;
  if (!rotation_only) stretches_ = weights * stretches;
}

Eigen::Matrix3d HandleBlend::at(Index j) const {
  const Eigen::Matrix3d R = rotation_by(turns_.row(j).transpose());
  if (stretches_.size() == 0) return R;
  return R + R * Eigen::Map<const Eigen::Matrix3d>(stretches_.row(j).data());
}

}  // namespace dd
