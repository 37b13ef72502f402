// SPDX-License-Identifier: GPL-3.0-or-later
#include "rotations.h"

#include <Eigen/LU>
#include <Eigen/SVD>

namespace dd {

Eigen::Matrix3d polar_rotation(const Eigen::Matrix3d& A) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(A, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d U = svd.matrixU();
  if ((U * svd.matrixV().transpose()).determinant() < 0) U.col(2) *= -1;
  return U * svd.matrixV().transpose();
}

}  // namespace dd
