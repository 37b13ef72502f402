// SPDX-License-Identifier: GPL-3.0-or-later
#include "reconstruction/limb_twist.h"

#include <algorithm>
#include <cmath>

namespace dd {

namespace {

// Least radius of a limb, as a fraction of the largest one. Safety: bounds how far the system's
// entries differ.
constexpr double kLeastRadius = 1e-3;
// Squared cosines of half the angle by which a rotation swings the limb's axis away from where R_0
// takes it: up to 60° all of the twist is removed, from 120° on nothing. Near 180° it would be
// rounding.
constexpr double kFullUntil = 0.75, kNothingFrom = 0.25;

/// k of the active vertices: 1 where a limb is as thick as the thickest, or where there is none.
Eigen::VectorXd conductivities(const CrossSections& sections, double solidity) {
  const Index count = sections.shares.size();
  // An arm is the radius in the proportion of the share.
  Eigen::VectorXd radii = Eigen::VectorXd::Zero(count);
  double largest = 0;
  for (Index i = 0; i < count; ++i) {
    if (!(sections.shares[i] > 0)) continue;
    radii[i] = sections.arms.row(i).norm() / sections.shares[i];
    if (sections.shares[i] > 0.5) largest = std::max(largest, radii[i]);
  }
  Eigen::VectorXd found = Eigen::VectorXd::Ones(count);
  for (Index i = 0; i < count; ++i)
    if (sections.shares[i] > 0 && largest > 0)
      found[i] = std::pow(std::clamp(radii[i] / largest, kLeastRadius, 1.0),
                          -solidity * sections.shares[i]);
  return found;
}

/// Removes a rotation's twist about an axis in the proportion of a weight.
template <class Real>
Eigen::Quaternion<Real> without_twist(const Eigen::Quaternion<Real>& rotation,
                                      const Eigen::Matrix<Real, 3, 1>& axis, Real weight) {
  const Real along = rotation.vec().dot(axis), square = rotation.w() * rotation.w() + along * along;
  weight *=
      std::clamp((square - Real(kNothingFrom)) / Real(kFullUntil - kNothingFrom), Real(0), Real(1));
  if (weight == 0) return rotation;
  const Real scale = (rotation.w() < 0 ? -weight : weight) / std::sqrt(square);
  Eigen::Quaternion<Real> back;  // the inverse of the twist
  back.w() = 1 - weight + scale * rotation.w();
  back.vec() = -scale * along * axis;
  const Eigen::Quaternion<Real> result = rotation * back;
  return weight < 1 ? result.normalized() : result;
}

}  // namespace

/// The cotangent Laplacian with conductivities, factored for the free vertices.
class LimbTwist::Conduction {
 public:
  Conduction(const FactoredSurface& surface, const Eigen::VectorXd& conductivity)
      : poisson_(*surface.poisson) {
    const Triangles& t = surface.operators.triangles;
    TriangleMetric metric = surface.operators.metric;
    for (int j : poisson_.active().triangles) {
      double sum = 0;
      for (int v : t.row(j)) sum += conductivity[poisson_.active_index_of_vertex(v)];
      metric.cotangents.row(j) *= sum / 3;
    }
    const SparseMatrix laplacian = cotangent_laplacian(metric, t, surface.mesh.vertex_count());
    BlockOptions options;
    options.symbolic = poisson_.symbolic();
    options.pool = &poisson_.pool();
    options.precision = poisson_.precision();
    factor_ = std::make_unique<SparseCholesky>(
        factor_free_block(free_block(laplacian, surface.region), surface.region, options));
    const RowOrder& order = surface.order();
    for (int row = order.free_count; row < order.fixed_begin; ++row)
      for (SparseMatrix::InnerIterator it(laplacian, order.vertex_of_row[size_t(row)]); it; ++it)
        if (const int free_row = order.row_of_vertex[size_t(it.row())]; free_row < order.free_count)
          couplings_.push_back({free_row, row, -it.value()});
    right_ = Rows::Zero(factor_->symbolic().slotted_size(), 4);
  }

  void extend(Rows& values) {
    right_.setZero();
    for (const auto& [free_row, row, weight] : couplings_)
      right_.row(free_row) += weight * values.row(row);
    factor_->solve_in_order(
        right_.data(), scratch_, &poisson_.pool(), [](int) {},
        [&](int begin, int end, const auto* x) {
          for (int row = begin; row < end; ++row, x += 4)
            for (int c = 0; c < 3; ++c) values(row, c) = static_cast<double>(x[c]);
        });
  }

  double bytes() const {
    return factor_->bytes() + static_cast<double>(couplings_.size() * sizeof(Coupling)) +
           static_cast<double>(right_.size() * Index(sizeof(double)));
  }

 private:
  struct Coupling {
    int free_row, row;
    double weight;
  };

  const PoissonSystem& poisson_;
  std::unique_ptr<SparseCholesky> factor_;
  std::vector<Coupling> couplings_;  // of handles' vertices
  Rows right_;
  SparseCholesky::SolveScratch scratch_;
};

LimbTwist::LimbTwist(const FactoredSurface& surface, const CrossSections& sections, double solidity)
    : surface_(surface),
      sections_(sections),
      solidity_(solidity),
      conduction_(std::make_unique<Conduction>(surface, conductivities(sections, solidity))),
      blend_(surface, [this](Rows& values) { conduction_->extend(values); }) {}

LimbTwist::~LimbTwist() = default;

void LimbTwist::take(const HandleTurns& turns) {
  const RowOrder& order = surface_.order();
  blend_.set_values(turns.vectors);
  if (even_.rows() == 0) {
    even_ = Rows::Zero(order.count(), 4);
    even_.col(3).setOnes();
  }
  surface_.poisson->pool().parallel_for(
      order.free_count, kLeastRange, [&](int64_t begin, int64_t end) {
        const RowMatrix blended = blend_.rows(begin, end);
        for (int64_t i = begin; i < end; ++i)
          even_.row(i) = turns.rotation(blended.row(i - begin).data()).coeffs().transpose();
      });
  for (int row = order.free_count; row < order.fixed_begin; ++row)
    even_.row(row) =
        turns.rotation(turns.vectors.row(surface_.region.role[order.vertex_of_row[row]]).data())
            .coeffs()
            .transpose();
}

template <class Real>
void LimbTwist::run(std::vector<Real>& rotations, double weight) const {
  surface_.poisson->pool().parallel_for(
      surface_.order().free_count, kLeastRange, [&](int64_t begin, int64_t end) {
        for (int64_t i = begin; i < end; ++i) {
          const double solid = solidity_ * sections_.shares[i];
          if (solid == 0) continue;
          using Quaternion = Eigen::Quaternion<Real>;
          Eigen::Map<Quaternion> rotation(&rotations[4 * size_t(i)]);
          const Quaternion even = quaternion(even_, i).template cast<Real>();
          // All of it from a solidity of a half on: up to there R_0 is less than half a turn from
          // the rotations of a limb that is twisted by three turns, where a part of the twist
          // would be ambiguous.
          Quaternion left = without_twist<Real>(
              even.conjugate() * rotation, sections_.axes.row(i).transpose().template cast<Real>(),
              Real(weight * std::min(1.0, 2 * solid)));
          if (left.w() < 0) left.coeffs() *= -1;
          rotation = even * left;
        }
      });
}

template void LimbTwist::run(std::vector<float>&, double) const;
template void LimbTwist::run(std::vector<double>&, double) const;

double LimbTwist::bytes() const {
  return conduction_->bytes() + blend_.bytes() +
         static_cast<double>(even_.size() * Index(sizeof(double)));
}

}  // namespace dd
