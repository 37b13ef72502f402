// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <vector>

#include "reconstruction/cross_section_arms.h"
#include "reconstruction/factored_surface.h"

namespace dd {

/// Where a section bends sharply, turning arms makes triangles of its inside turn over. In terms of
/// the surface, centres and arms of CrossSections add to the rotated gradients those of the arms:
///
///   L p' = div(R ∇p + E),   E = ∇(R r) − R ∇r.
///
/// This adds (λ − 1) div(E) to the right-hand side, per triangle: λ = 1 where R + E keeps the area
/// in R's plane, so also under the shear of a twist, and less where it would compress that to less
/// than a fraction of it.
class FoldLimits {
 public:
  explicit FoldLimits(const FactoredSurface& surface) : surface_(surface) {}

  /// Chooses the triangles that have an arm.
  void set(const CrossSectionArms& arms);

  /// As the add of PoissonSystem::solve(). positions: p, rows in the surface's order. quaternions:
  /// R by active index, of any length.
  template <class Real>
  void add(const Rows& positions, const CrossSectionArms& arms, const Real* quaternions,
           int section, double* rows) const {
    if (triangles_.empty()) return;
    for (int i = begin_[size_t(section)]; i < begin_[size_t(section) + 1]; ++i) {
      const Triangle& triangle = triangles_[size_t(i)];
      const auto apart = [&](int j, int k) {
        using Map = Eigen::Map<const Eigen::Matrix<Real, 4, 1>>;
        return (Map(quaternions + 4 * Index(triangle.corner[j])) -
                Map(quaternions + 4 * Index(triangle.corner[k])))
            .squaredNorm();
      };
      if (std::max({apart(0, 1), apart(1, 2), apart(2, 0)}) < Real(triangle.harmless)) continue;
      // mean: R of the triangle. beyond: of the corners, R r without what R of the triangle does.
      Eigen::Matrix3d mean = Eigen::Matrix3d::Zero(), p, beyond;
      for (int k = 0; k < 3; ++k) {
        const int corner = triangle.corner[k];
        const Eigen::Quaterniond q(
            Eigen::Map<const Eigen::Quaternion<Real>>(quaternions + 4 * Index(corner))
                .template cast<double>());
        mean += (1.0 / 3) * q.normalized().toRotationMatrix();
        p.col(k) = positions.row(surface_.poisson->active_row(corner)).head<3>().transpose();
      }
      for (int k = 0; k < 3; ++k)
        beyond.col(k) = arms.after(triangle.corner[k]) - mean * arms.before(triangle.corner[k]);
      const double factor = factor_of(mean, p, beyond);
      if (factor == 1) continue;
      const auto cotangents = surface_.operators.metric.cotangents.row(triangle.number);
      for (int k = 0; k < 3; ++k) {
        const int next = (k + 1) % 3, last = (k + 2) % 3;
        Eigen::Map<Eigen::Vector3d>(rows + 4 * Index(triangle.target[k])) +=
            0.5 * (factor - 1) *
            (cotangents[last] * (beyond.col(k) - beyond.col(next)) +
             cotangents[next] * (beyond.col(k) - beyond.col(last)));
      }
    }
  }

  double bytes() const {
    return static_cast<double>(triangles_.size() * sizeof(Triangle) + begin_.size() * sizeof(int));
  }

 private:
  struct Triangle {
    int number;
    int corner[3];  // active indices
    int target[3];  // rows of a right-hand side
    // Squared distance of the corners' quaternions, below which λ = 1.
    double harmless;
  };
  /// λ
  static double factor_of(const Eigen::Matrix3d& mean, const Eigen::Matrix3d& p,
                          const Eigen::Matrix3d& beyond);

  const FactoredSurface& surface_;
  std::vector<Triangle> triangles_;
  std::vector<int> begin_;  // by section
};

}  // namespace dd
