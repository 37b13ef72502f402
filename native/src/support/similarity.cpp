// SPDX-License-Identifier: GPL-3.0-or-later
#include "support/similarity.h"

#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "support/rotations.h"

namespace dd {

namespace {

/// Points relative to their weighted mean; square: Σ w ‖arm‖².
struct Spread {
  Spread(const Positions& points, const Eigen::VectorXd& weights)
      : mean(weights.transpose() * points / weights.sum()),
        arms(points.rowwise() - mean),
        square(arms.rowwise().squaredNorm().dot(weights)) {}
  Eigen::RowVector3d mean;
  Positions arms;
  double square;
};

// Largest ratio of misfit to spread (root mean squares) of a copy, whose points alone decide.
constexpr double kMaxMisfitOfCopy = 1e-3;
// Least ratio of the smallest to the largest singular value of the points' cross-covariance, that
// is of squared extents: a reflection fits flatter points as well as a rotation.
constexpr double kMinSingularValueRatio = 1e-2;
// Largest ratio of a reflection's squared misfit to a rotation's at which points are mirrored.
constexpr double kMaxReflectedMisfit = 0.5;

Similarity with_rotation(const Eigen::Matrix3d& rotation, const Spread& from, const Spread& to) {
  Similarity fit;
  fit.rotation = rotation;
  if (from.square > 0 && to.square > 0) fit.scale = std::sqrt(to.square / from.square);
  fit.shift = (to.mean - fit.scale * from.mean * rotation.transpose()).transpose();
  return fit;
}

/// The rotation R that takes most normals to their partners: minimizes Σ w ‖n_to − R n_from‖ by
/// iteratively reweighted least squares. The norm is not squared, so parts that are posed otherwise
/// have little influence. A weak pull towards guess decides where nearly parallel normals don't.
Eigen::Matrix3d rotation_of_most(const Positions& from, const Positions& to,
                                 const Eigen::VectorXd& weights, const Eigen::Matrix3d& guess) {
  constexpr int kIterations = 20;
  // kNormalNoise: difference of unit normals (11°) below which the norm is nearly quadratic.
  // kGuessWeight: the guess's weight as a fraction of the normals' sum.
  constexpr double kNormalNoise = 0.2, kGuessWeight = 0.02;
  Eigen::Matrix3d rotation = guess;
  Eigen::VectorXd now = weights;
  for (int round = 0; round < kIterations; ++round) {
    const Eigen::Matrix3d covariance = to.transpose() * now.asDiagonal() * from;
    rotation = polar_rotation(covariance + kGuessWeight * now.sum() * guess);
    const Eigen::VectorXd apart = (to - from * rotation.transpose()).rowwise().squaredNorm();
    now = weights.array() / (apart.array() + kNormalNoise * kNormalNoise).sqrt();
  }
  return rotation;
}

/// Weight in [0, 1] of an angle between two placements: 0 up to 3°, which a difference of shape
/// explains, 1 from 5° on, linear between. Heads of one family are tilted by up to 2.2°
/// (native/bench/RESULTS.md).
double placement_weight(double angle) {
  constexpr double kDegree = kPi / 180, kIgnored = 3 * kDegree, kFull = 5 * kDegree;
  return std::clamp((angle - kIgnored) / (kFull - kIgnored), 0.0, 1.0);
}

Eigen::Matrix3d nearest_of_axes(const Eigen::Matrix3d& rotation) {
  const std::vector<Eigen::Matrix3d> all = rotations_of_axes();
  return *std::max_element(all.begin(), all.end(), [&](const auto& a, const auto& b) {
    return a.cwiseProduct(rotation).sum() < b.cwiseProduct(rotation).sum();
  });
}

}  // namespace

std::vector<Eigen::Matrix3d> rotations_of_axes() {
  std::vector<Eigen::Matrix3d> all;
  int order[3] = {0, 1, 2};
  do {
    for (int signs = 0; signs < 8; ++signs) {
      Eigen::Matrix3d candidate = Eigen::Matrix3d::Zero();
      for (int k = 0; k < 3; ++k) candidate(order[k], k) = (signs >> k & 1) ? -1 : 1;
      if (candidate.determinant() > 0) all.push_back(candidate);
    }
  } while (std::next_permutation(order, order + 3));
  return all;
}

Similarity fitted_similarity(const Positions& from, const Positions& to,
                             const Eigen::VectorXd& weights) {
  if (!(weights.sum() > 0)) return {};
  const Spread of(from, weights), onto(to, weights);
  const Eigen::Matrix3d covariance = onto.arms.transpose() * weights.asDiagonal() * of.arms;
  const Eigen::Vector3d values = Eigen::JacobiSVD<Eigen::Matrix3d>(covariance).singularValues();
  // Safety: within a thousandth of a line, the rotation about it is decided by errors.
  const bool on_a_line = !(values[1] > 1e-6 * values[0]);
  return with_rotation(
      on_a_line ? Eigen::Matrix3d(Eigen::Matrix3d::Identity()) : polar_rotation(covariance), of,
      onto);
}

bool is_mirror_image(const Positions& from, const Positions& to, const Eigen::VectorXd& weights) {
  if (!(weights.sum() > 0)) return false;
  const Spread of(from, weights), onto(to, weights);
  const Eigen::Matrix3d covariance = onto.arms.transpose() * weights.asDiagonal() * of.arms;
  if (!(covariance.determinant() < 0)) return false;
  const Eigen::Vector3d values = Eigen::JacobiSVD<Eigen::Matrix3d>(covariance).singularValues();
  const double whole = std::sqrt(of.square * onto.square);
  const double reflected = whole - values.sum(), rotated = reflected + 2 * values[2];
  return values[2] > kMinSingularValueRatio * values[0] &&
         reflected < kMaxReflectedMisfit * rotated;
}

namespace {

Similarity upright_placement(const OrientedPoints& from, const OrientedPoints& to,
                             const Eigen::VectorXd& weights) {
  const Similarity fit = fitted_similarity(from.positions, to.positions, weights);
  if (!(weights.sum() > 0)) return fit;
  const Spread of(from.positions, weights), onto(to.positions, weights);
  const Positions misfit = onto.arms - fit.scale * of.arms * fit.rotation.transpose();
  if (misfit.rowwise().squaredNorm().dot(weights) <
      kMaxMisfitOfCopy * kMaxMisfitOfCopy * onto.square)
    return fit;

  const Eigen::Matrix3d most = rotation_of_most(from.normals, to.normals, weights, fit.rotation);
  const Eigen::Vector3d apart = rotation_vector(fit.rotation.transpose() * most);
  const Eigen::Matrix3d found = fit.rotation * rotation_by(placement_weight(apart.norm()) * apart);

  const Eigen::Matrix3d upright = nearest_of_axes(found);
  const auto turned = [&](const Eigen::Matrix3d& rotation) {
    return rotation_vector(upright.transpose() * rotation);
  };
  const double least = std::min(turned(most).norm(), turned(fit.rotation).norm());
  return with_rotation(upright * rotation_by(placement_weight(least) * turned(found)), of, onto);
}

}  // namespace

Similarity fitted_placement(const OrientedPoints& from, const OrientedPoints& to,
                            const Eigen::VectorXd& weights) {
  if (!is_mirror_image(from.positions, to.positions, weights))
    return upright_placement(from, to, weights);
  const Eigen::Vector3d reflection(-1, 1, 1);
  OrientedPoints image = {from.positions * reflection.asDiagonal(),
                          from.normals * reflection.asDiagonal()};
  // If the source's triangles are not reversed by the reflection, its normals point inwards.
  const Eigen::Matrix3d rotation =
      fitted_similarity(image.positions, to.positions, weights).rotation;
  const Eigen::VectorXd agreement =
      (image.normals * rotation.transpose()).cwiseProduct(to.normals).rowwise().sum();
  if (agreement.dot(weights) < 0) image.normals *= -1;
  Similarity fit = upright_placement(image, to, weights);
  fit.rotation = fit.rotation * reflection.asDiagonal();
  fit.mirrored = true;
  return fit;
}

}  // namespace dd
