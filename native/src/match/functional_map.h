// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <vector>

#include "support/types.h"

namespace dd {

/// For each row of either matrix, the index of the nearest row of the other.
struct NearestRows {
  std::vector<int> of_first, of_second;
};
NearestRows nearest_rows(const RowMatrix& first, const RowMatrix& second);

/// A functional map (Ovsjanikov et al. 2012): a k×k matrix that takes the values of the source's
/// first k eigenfunctions at a point to those of the target's at the corresponding point.
struct FunctionalMap {
  Eigen::MatrixXd matrix;
  int size() const { return static_cast<int>(matrix.rows()); }
  /// Takes values of the source's eigenfunctions, one row a point, to those of the target's.
  RowMatrix operator()(const RowMatrix& source) const;
};

/// Values of each surface's eigenfunctions, one row a sample point, and pairs of such rows that are
/// known to correspond.
struct SampledFunctions {
  RowMatrix source, target;
  std::vector<std::array<Eigen::RowVectorXd, 2>> landmarks;  ///< source, target
};

/// Refines a correspondence of samples (ZoomOut: Melzi et al. 2019), in both directions at once:
/// fits a map and takes the nearest rows by it, with `step` more eigenfunctions each time, from
/// `first` to `last`. start: the corresponding rows of the samples.
FunctionalMap zoomed_out(const SampledFunctions& samples, NearestRows start, int first, int last,
                         int step);

/// How far a map C is from an isometry, which commutes with the Laplacians:
/// ‖Λ_target C − C Λ_source‖ / (‖C‖ λ), λ the largest eigenvalue of both. 0 for an isometry.
double stretch_of(const FunctionalMap& map, const Eigen::VectorXd& source_values,
                  const Eigen::VectorXd& target_values);

}  // namespace dd
