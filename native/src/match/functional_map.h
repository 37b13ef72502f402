// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <vector>

#include "support/types.h"

namespace dd {

/// For each row of either matrix the number of the nearest row of the other.
struct NearestRows {
  std::vector<int> of_first, of_second;
};
NearestRows nearest_rows(const RowMatrix& first, const RowMatrix& second);

/// A correspondence of two surfaces as a linear map of their functions (Ovsjanikov et al. 2012):
/// k×k, what takes values of the source's first functions at a point to those of the target's at
/// the point that corresponds.
struct FunctionalMap {
  Eigen::MatrixXd matrix;
  int size() const { return static_cast<int>(matrix.rows()); }
  /// Of points: rows of the source's functions, in the target's.
  RowMatrix operator()(const RowMatrix& source) const;
};

/// The values of each surface's functions at some of its points, and rows of them that correspond
/// for sure.
struct SampledFunctions {
  RowMatrix source, target;
  std::vector<std::array<Eigen::RowVectorXd, 2>> landmarks;  ///< source, target
};

/// Refines a rough correspondence by adding functions, step by step from the smoothest on (ZoomOut:
/// Melzi et al. 2019), in both directions at once. start: rows of the samples that
/// correspond.
FunctionalMap zoomed_out(const SampledFunctions& samples, NearestRows start, int first, int last,
                         int step);

/// How far a map is from one that keeps lengths: such commute with the Laplacians. 0 where it does.
double stretch_of(const FunctionalMap& map, const Eigen::VectorXd& source_values,
                  const Eigen::VectorXd& target_values);

}  // namespace dd
