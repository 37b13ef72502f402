// SPDX-License-Identifier: GPL-3.0-or-later
#include "support/rotations.h"

#include <Eigen/LU>
#include <Eigen/SVD>
#include <cmath>

namespace dd {

namespace {

// The least determinant of a matrix, over its norm cubed, from which Newton's iteration takes less
// than kMostSteps. Safety: a thousandth of a rotation's, 0.19.
constexpr double kLeastDeterminant = 2e-4;
constexpr int kMostSteps = 16;
// A step below which the next one would be below 1e-14.
constexpr double kLastStep = 1e-7;

}  // namespace

Eigen::Matrix3d polar_rotation(const Eigen::Matrix3d& A) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(A, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d U = svd.matrixU();
  if ((U * svd.matrixV().transpose()).determinant() < 0) U.col(2) *= -1;
  return U * svd.matrixV().transpose();
}

Eigen::Matrix3d polar_rotation_by_newton(const Eigen::Matrix3d& A) {
  const double determinant = A.determinant(), norm = A.norm();
  if (!(determinant > kLeastDeterminant * norm * norm * norm)) return polar_rotation(A);
  Eigen::Matrix3d X = A / std::cbrt(determinant);
  for (int step = 0; step < kMostSteps; ++step) {
    Eigen::Matrix3d cofactors;
    cofactors << X.col(1).cross(X.col(2)), X.col(2).cross(X.col(0)), X.col(0).cross(X.col(1));
    const Eigen::Matrix3d change = 0.5 * (cofactors / X.col(0).dot(cofactors.col(0)) - X);
    X += change;
    if (change.cwiseAbs().maxCoeff() < kLastStep) break;
  }
  return X;
}

Eigen::Matrix3d rotation_or(const Eigen::Matrix3d& A, const Eigen::Vector3d& turn) {
  return A.determinant() > 0 ? polar_rotation(A) : rotation_by(turn);
}

Eigen::Vector3d rotation_vector(const Eigen::Matrix3d& R) {
  const Eigen::AngleAxisd turn(R);
  return turn.angle() * turn.axis();
}

Eigen::Matrix3d rotation_by(const Eigen::Vector3d& turn) {
  const double angle = turn.norm();
  if (angle == 0) return Eigen::Matrix3d::Identity();
  return Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix();
}

Eigen::Vector3d rotation_vector_near(const Eigen::AngleAxisd& shortest,
                                     const Eigen::Vector3d& near) {
  Eigen::Vector3d axis = shortest.axis();
  // The axis of an angle below 1e-9 rad is rounding: whole turns are then about near's axis.
  if (shortest.angle() < 1e-9 && near.norm() > kPi) axis = near.normalized();
  const double whole_turns = std::round((near.dot(axis) - shortest.angle()) / (2 * kPi));
  return (shortest.angle() + 2 * kPi * whole_turns) * axis;
}

Eigen::Quaterniond quaternion_by(const Eigen::Vector3d& turn) {
  const double half = 0.5 * turn.norm();
  Eigen::Quaterniond q;
  if (half > 1e-8) {
    q.w() = std::cos(half);
    q.vec() = 0.5 * std::sin(half) / half * turn;
  } else {  // there cos x and sin(x) / x are 1 in double precision
    q.w() = 1;
    q.vec() = 0.5 * turn;
  }
  return q;
}

}  // namespace dd
