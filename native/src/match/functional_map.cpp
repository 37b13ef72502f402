// SPDX-License-Identifier: GPL-3.0-or-later
#include "match/functional_map.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <limits>

namespace dd {

namespace {

constexpr Index kRowsPerProduct =
    64;  // rows of distances computed by one product: bounds its memory
constexpr double kLandmarkWeight =
    0.05;  // weight of a landmark, as a fraction of all samples' together
// Added to the normal matrix' diagonal, as a fraction of the number of samples, which is about its
// size. Safety: functions that the samples don't determine would make it singular.
constexpr double kRidge = 1e-6;

/// The least squares map of `size` functions from source rows to corresponding target rows.
FunctionalMap fitted_map(const SampledFunctions& samples, const NearestRows& rows, int size) {
  const Index from = samples.source.rows(), to = samples.target.rows();
  Eigen::MatrixXd source(from + to, size), target(from + to, size);
  for (Index i = 0; i < from; ++i) {
    source.row(i) = samples.source.row(i).head(size);
    target.row(i) = samples.target.row(rows.of_first[size_t(i)]).head(size);
  }
  for (Index i = 0; i < to; ++i) {
    source.row(from + i) = samples.source.row(rows.of_second[size_t(i)]).head(size);
    target.row(from + i) = samples.target.row(i).head(size);
  }
  // Fits target · matrix ≈ source: functions go from target to source, points by its transpose.
  Eigen::MatrixXd normal = target.transpose() * target;
  Eigen::MatrixXd right = target.transpose() * source;
  const double weight = kLandmarkWeight * static_cast<double>(from + to);
  for (const auto& [of_source, of_target] : samples.landmarks) {
    const Eigen::VectorXd there = of_source.head(size), target_values_there = of_target.head(size);
    normal += weight * target_values_there * target_values_there.transpose();
    right += weight * target_values_there * there.transpose();
  }
  normal.diagonal().array() += kRidge * static_cast<double>(from + to);
  return {Eigen::LDLT<Eigen::MatrixXd>(normal).solve(right)};
}

}  // namespace

NearestRows nearest_rows(const RowMatrix& first, const RowMatrix& second) {
  NearestRows found;
  found.of_first.assign(static_cast<size_t>(first.rows()), 0);
  found.of_second.assign(static_cast<size_t>(second.rows()), 0);
  const Eigen::RowVectorXd squares = second.rowwise().squaredNorm().transpose();
  Eigen::RowVectorXd least =
      Eigen::RowVectorXd::Constant(second.rows(), std::numeric_limits<double>::infinity());
  for (Index begin = 0; begin < first.rows(); begin += kRowsPerProduct) {
    const Index count = std::min(kRowsPerProduct, first.rows() - begin);
    RowMatrix distances = -2 * first.middleRows(begin, count) * second.transpose();
    distances.rowwise() += squares;
    for (Index i = 0; i < count; ++i) {
      Index best = 0;
      distances.row(i).minCoeff(&best);
      found.of_first[size_t(begin + i)] = static_cast<int>(best);
      const double square = first.row(begin + i).squaredNorm();
      for (Index j = 0; j < second.rows(); ++j)
        if (distances(i, j) + square < least[j]) {
          least[j] = distances(i, j) + square;
          found.of_second[size_t(j)] = static_cast<int>(begin + i);
        }
    }
  }
  return found;
}

RowMatrix FunctionalMap::operator()(const RowMatrix& source) const {
  return source.leftCols(size()) * matrix.transpose();
}

FunctionalMap zoomed_out(const SampledFunctions& samples, NearestRows start, int first, int last,
                         int step) {
  FunctionalMap map;
  for (int size = first; size <= last; size += step) {
    map = fitted_map(samples, start, size);
    start = nearest_rows(map(samples.source), samples.target.leftCols(size));
  }
  return fitted_map(samples, start, last);
}

double stretch_of(const FunctionalMap& map, const Eigen::VectorXd& source_values,
                  const Eigen::VectorXd& target_values) {
  const int size = map.size();
  double square = 0;
  for (int i = 0; i < size; ++i)
    for (int j = 0; j < size; ++j) {
      const double difference = target_values[i] - source_values[j];
      square += difference * difference * map.matrix(i, j) * map.matrix(i, j);
    }
  const double most = std::max(source_values[size - 1], target_values[size - 1]);
  return std::sqrt(square) / (map.matrix.norm() * most);
}

}  // namespace dd
