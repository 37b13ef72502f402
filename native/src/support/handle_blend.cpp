// SPDX-License-Identifier: GPL-3.0-or-later
#include "support/handle_blend.h"

#include "support/rotations.h"

namespace dd {

RowMatrix blend_terms(const std::vector<Eigen::Matrix3d>& linear, bool rotation_only) {
  RowMatrix terms(static_cast<Index>(linear.size()), rotation_only ? 3 : 12);
  for (Index h = 0; h < terms.rows(); ++h) {
    const Eigen::Matrix3d& A = linear[static_cast<size_t>(h)];
    const Eigen::Matrix3d R = polar_rotation(A);
    terms.row(h).head<3>() = rotation_vector(R).transpose();
    if (rotation_only) continue;
    const Eigen::Matrix3d change = R.transpose() * A - Eigen::Matrix3d::Identity();
    terms.row(h).tail<9>() = change.reshaped().transpose();
  }
  return terms;
}

Eigen::Matrix3d blended(const Eigen::Ref<const Eigen::RowVectorXd>& sums) {
  const Eigen::Matrix3d R = rotation_by(sums.head<3>().transpose());
  if (sums.size() == 3) return R;
  return R + R * Eigen::Map<const Eigen::Matrix3d>(sums.data() + 3);
}

}  // namespace dd
