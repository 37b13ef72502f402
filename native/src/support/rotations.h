// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Geometry>

#include "support/types.h"

namespace dd {

constexpr double kPi = 3.14159265358979323846;

/// A row x y z w.
inline Eigen::Quaterniond quaternion(const Rows& rows, Index r) {
  return Eigen::Quaterniond(Eigen::Vector4d(rows.row(r).transpose()));
}

/// The rotation R nearest to A, the one of its polar decomposition A = R U where A keeps
/// orientation; its determinant is +1 whatever A is.
Eigen::Matrix3d polar_rotation(const Eigen::Matrix3d& A);

/// The same where A keeps orientation; what mirrors or flattens has no rotation of its own and gets
/// the turn's, of rotation_by().
Eigen::Matrix3d rotation_or(const Eigen::Matrix3d& A, const Eigen::Vector3d& turn);

/// The logarithm of a rotation, axis times angle, at most half a turn; and its inverse.
Eigen::Vector3d rotation_vector(const Eigen::Matrix3d& R);
Eigen::Matrix3d rotation_by(const Eigen::Vector3d& turn);

/// The rotation vector of the given rotation, at most half a turn, that is nearest to near: angles
/// differ by whole turns.
Eigen::Vector3d rotation_vector_near(const Eigen::AngleAxisd& shortest,
                                     const Eigen::Vector3d& near);

}  // namespace dd
