// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "reconstruction/cross_sections.h"
#include "reconstruction/factored_surface.h"
#include "reconstruction/rotation_means.h"
#include "reconstruction/turning.h"

namespace dd {

/// Means of rotations over CrossSections.
template <class Real>
class CrossSectionMeans {
 public:
  CrossSectionMeans(const FactoredSurface& surface, const CrossSections& sections)
      : surface_(surface) {
    for (int i = 0; i < surface.poisson->active_vertex_count(); ++i)
      if (i < surface.order().free_count)
        means_.append(sections.means[size_t(i)]);
      else
        means_.append({{i, 1.0}});  // rims keep the rotations of their handles
    means_.close();
  }

  /// Before run(), of each pose. Where the surface turns far, means are taken of the rotations
  /// relative to the gauge, as rotations a turn apart have no mean.
  void take_gauge(const Turning& turning) {
    gauge_.clear();
    if (!turning.gauge || turning.gauge_weight == 0) return;
    gauge_.resize(4 * size_t(surface_.poisson->active_vertex_count()));
    each([&](int i, Map q) { q = gauge(turning, i); }, gauge_);
  }

  /// rotations: rows of 4 by active index, padded to blocks; replaced by their means in the
  /// proportion of solidity. rounds: 1 or more.
  void run(double solidity, int rounds, std::vector<Real>& rotations) {
    const bool relative = !gauge_.empty();
    now_.resize(rotations.size());
    next_.resize(rotations.size());
    if (relative) {
      next_ = rotations;
      each([&](int i, Map q) { q = q * of_gauge(i).conjugate(); }, next_);
    }
    for (int round = 0; round < rounds; ++round) {
      means_.run(relative || round > 0 ? next_ : rotations, now_, surface_.poisson->pool());
      now_.swap(next_);
    }
    now_.swap(next_);
    each(
        [&](int i, Map mean) {
          if (relative) mean = mean * of_gauge(i);
          Map q(&rotations[4 * size_t(i)]);
          const Real sign = q.dot(mean) < 0 ? Real(-1) : Real(1);
          q.coeffs() += Real(solidity) * (sign * mean.coeffs() - q.coeffs());
          if (solidity < 1) q.normalize();
        },
        now_);
  }

  double bytes() const {
    return means_.bytes() +
           static_cast<double>((gauge_.size() + now_.size() + next_.size()) * sizeof(Real));
  }

 private:
  using Quaternion = Eigen::Quaternion<Real>;
  using Map = Eigen::Map<Quaternion>;

  template <class Body>
  void each(const Body& body, std::vector<Real>& quaternions) const {
    surface_.poisson->pool().parallel_for(
        surface_.poisson->active_vertex_count(), kLeastRange, [&](int64_t begin, int64_t end) {
          for (int64_t i = begin; i < end; ++i)
            body(static_cast<int>(i), Map(&quaternions[4 * size_t(i)]));
        });
  }

  Quaternion of_gauge(int i) const { return Eigen::Map<const Quaternion>(&gauge_[4 * size_t(i)]); }
  /// The gauge, in the proportion of its weight; as long as that is below 1, it turns by less than
  /// 135°.
  Quaternion gauge(const Turning& turning, int i) const {
    Quaternion q(Eigen::Matrix<Real, 4, 1>(
        turning.gauge->row(surface_.poisson->active_row(i)).transpose().template cast<Real>()));
    if (turning.gauge_weight == 1) return q;
    q.coeffs() *= Real(turning.gauge_weight);
    q.w() += Real(1 - turning.gauge_weight);
    return q.normalized();
  }

  const FactoredSurface& surface_;
  RotationMeans<Real> means_;
  std::vector<Real> gauge_, now_, next_;  // gauge_: empty if nothing turns far
};

}  // namespace dd
