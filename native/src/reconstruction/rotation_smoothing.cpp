// SPDX-License-Identifier: GPL-3.0-or-later
#include "reconstruction/rotation_smoothing.h"

#include <algorithm>

namespace dd {

RotationSmoothing::RotationSmoothing(const FactoredSurface& surface, double length,
                                     const Eigen::VectorXd& masses)
    : poisson_(*surface.poisson) {
  const RowOrder& order = poisson_.order();
  const Region& region = surface.region;
  const double weight = length * length;
  SparseMatrix block = free_block(surface.operators.laplacian, region);
  block *= weight;
  for (int r = 0; r < region.free_count(); ++r) block.coeffRef(r, r) += masses[region.free[r]];
  BlockOptions options;
  options.symbolic = poisson_.symbolic();
  options.pool = &poisson_.pool();
  options.precision = poisson_.precision();
  factor_ = std::make_unique<SparseCholesky>(factor_free_block(block, region, options));

  masses_.resize(order.free_count);
  for (int r = 0; r < order.free_count; ++r) masses_[r] = masses[order.vertex_of_row[r]];
  const std::vector<int>& rims = poisson_.rims();
  for (size_t i = 0; i < rims.size(); ++i) {
    const int v = order.vertex_of_row[rims[i]];
    for (SparseMatrix::InnerIterator it(surface.operators.laplacian, v); it; ++it)
      if (region.row[it.row()] >= 0)
        couplings_.push_back({order.row_of_vertex[it.row()], order.free_count + static_cast<int>(i),
                              -weight * it.value()});
  }
  right_ = Rows::Zero(factor_->symbolic().slotted_size(), 4);
}

template <class Real>
void RotationSmoothing::run(Real* quaternions, double fraction) {
  const auto quaternion = [=](Index row) {
    return Eigen::Map<Eigen::Matrix<Real, 1, 4>>(quaternions + 4 * row);
  };
  poisson_.pool().parallel_for(masses_.size(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (int64_t r = begin; r < end; ++r)
      right_.row(r) = masses_[r] * quaternion(r).template cast<double>();
  });
  for (const Coupling& coupling : couplings_)
    right_.row(coupling.row) += coupling.weight * quaternion(coupling.rim).template cast<double>();
  factor_->solve_in_order(
      right_.data(), scratch_, &poisson_.pool(), [](int) {},
      [&](int begin, int end, const auto* x) {
        Real* to = quaternions + 4 * Index(begin);
        for (Index i = 0; i < 4 * Index(end - begin); ++i)
          to[i] += static_cast<Real>(fraction * (static_cast<double>(x[i]) - to[i]));
      },
      Columns::four);
}

template void RotationSmoothing::run(float*, double);
template void RotationSmoothing::run(double*, double);

double RotationSmoothing::bytes() const {
  return factor_->bytes() +
         static_cast<double>((masses_.size() + right_.size()) * Index(sizeof(double))) +
         static_cast<double>(couplings_.size() * sizeof(Coupling) +
                             scratch_.single.size() * sizeof(float) +
                             scratch_.full.size() * sizeof(double));
}

}  // namespace dd
