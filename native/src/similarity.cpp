// SPDX-License-Identifier: GPL-3.0-or-later
#include "similarity.h"

#include <Eigen/SVD>
#include <cmath>

#include "rotations.h"

namespace dd {

Similarity fitted_similarity(const Positions& from, const Positions& to,
                             const Eigen::VectorXd& weights) {
  Similarity fit;
  const double whole = weights.sum();
  if (!(whole > 0)) return fit;
  const Eigen::RowVector3d from_mean = weights.transpose() * from / whole;
  const Eigen::RowVector3d to_mean = weights.transpose() * to / whole;
  const Positions from_arms = from.rowwise() - from_mean, to_arms = to.rowwise() - to_mean;
  const Eigen::Matrix3d both = to_arms.transpose() * weights.asDiagonal() * from_arms;
  const Eigen::Vector3d values = Eigen::JacobiSVD<Eigen::Matrix3d>(both).singularValues();
  if (values[1] > 1e-6 * values[0]) fit.rotation = polar_rotation(both);
  const double from_spread = from_arms.rowwise().squaredNorm().dot(weights);
  const double to_spread = to_arms.rowwise().squaredNorm().dot(weights);
  if (from_spread > 0 && to_spread > 0) fit.scale = std::sqrt(to_spread / from_spread);
  fit.shift = (to_mean - fit.scale * from_mean * fit.rotation.transpose()).transpose();
  return fit;
}

}  // namespace dd
