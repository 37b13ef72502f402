// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Geometry>

#include "support/types.h"

namespace dd {

constexpr double kPi = 3.14159265358979323846;

/// The unit quaternion in row r, stored as x y z w.
inline Eigen::Quaterniond quaternion(const Rows& rows, Index r) {
  return Eigen::Quaterniond(Eigen::Vector4d(rows.row(r).transpose()));
}

/// The rotation R nearest to A in the Frobenius norm, always with det R = +1. If det A > 0 it is
/// that of the polar decomposition A = R U.
Eigen::Matrix3d polar_rotation(const Eigen::Matrix3d& A);

/// The same by Newton's iteration X ← (X + X⁻ᵀ)/2, which converges quadratically and takes a
/// tenth of the time of singular values. What is flat or mirrored has these.
Eigen::Matrix3d polar_rotation_by_newton(const Eigen::Matrix3d& A);

/// polar_rotation(A) if det A > 0. Otherwise A mirrors or is singular, its rotation is not
/// meaningful, and the result is rotation_by(turn).
Eigen::Matrix3d rotation_or(const Eigen::Matrix3d& A, const Eigen::Vector3d& turn);

/// The logarithm of a rotation, axis times angle, the angle in [0, π]; and the exponential, of any
/// angle.
Eigen::Vector3d rotation_vector(const Eigen::Matrix3d& R);
Eigen::Matrix3d rotation_by(const Eigen::Vector3d& turn);
/// The exponential as a quaternion, continuous beyond 360°: its sign is not normalized.
Eigen::Quaterniond quaternion_by(const Eigen::Vector3d& turn);

/// Of all rotation vectors of a rotation, which differ by whole turns about its axis, the one
/// nearest to near. shortest: the rotation, its angle in [0, π].
Eigen::Vector3d rotation_vector_near(const Eigen::AngleAxisd& shortest,
                                     const Eigen::Vector3d& near);

}  // namespace dd
