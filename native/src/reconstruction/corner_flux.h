// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "reconstruction/factored_surface.h"

namespace dd {

/// Adds the contribution of gradients X_j of active triangles to a right-hand side of (14): X_j g_k
/// at corner k, g_k the corner's flux on S (corner_divergence()). This takes the gradients as
/// matrices; kernels do the same for blocks of triangles.
class CornerFlux {
 public:
  /// For all active triangles.
  explicit CornerFlux(const FactoredSurface& surface);
  /// chosen: ascending indices into ActiveTriangles::triangles.
  CornerFlux(const FactoredSurface& surface, const std::vector<int>& chosen);

  /// gradient_of(k, triangle) returns X_j of the k-th of these triangles.
  template <class GradientOf>
  void add(int section, const GradientOf& gradient_of, double* rows) const {
    for (int k = begin_[section]; k < begin_[section + 1]; ++k) {
      const Corners& corners = corners_[k];
      const Eigen::Matrix3d contribution = gradient_of(k, corners.triangle) * corners.flux;
      for (int c = 0; c < 3; ++c)
        Eigen::Map<Eigen::Vector3d>(rows + 4 * Index(corners.target[c])) += contribution.col(c);
    }
  }
  int size() const { return static_cast<int>(corners_.size()); }
  double bytes() const { return static_cast<double>(corners_.size() * sizeof(Corners)); }

 private:
  struct Corners {
    Eigen::Matrix3d flux;  // one column per corner
    int target[3];         // rows of a right-hand side
    int triangle;
  };
  std::vector<Corners> corners_;
  std::vector<int> begin_;  // by section
};

}  // namespace dd
