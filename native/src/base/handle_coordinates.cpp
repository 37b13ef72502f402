// SPDX-License-Identifier: GPL-3.0-or-later
#include "base/handle_coordinates.h"

#include <Eigen/Eigenvalues>

namespace dd {

namespace {

// Least extent of a handle along a principal axis, in the unit box. Safety: 4,500 times the
// rounding of a double of size 1. Coordinates along a shorter axis would be rounding errors, and
// the basis function solved for them, too.
constexpr double kMinHandleExtent = 1e-12;

}  // namespace

Positions handle_centres(const Region& region, const Positions& positions) {
  Positions centres = Positions::Zero(region.handle_count, 3);
  Eigen::VectorXd counts = Eigen::VectorXd::Zero(region.handle_count);
  for (int v : region.handle_vertices) {
    centres.row(region.role[v]) += positions.row(v);
    counts[region.role[v]] += 1;
  }
  centres.array().colwise() /= counts.array();
  return centres;
}

HandleCoordinates::HandleCoordinates(const Region& region, const Positions& positions)
    : centres_(handle_centres(region, positions)) {
  std::vector<Eigen::Matrix3d> scatter(size_t(region.handle_count), Eigen::Matrix3d::Zero());
  const auto arm = [&](int v) -> Eigen::RowVector3d {
    return positions.row(v) - centres_.row(region.role[v]);
  };
  for (int v : region.handle_vertices) scatter[region.role[v]] += arm(v).transpose() * arm(v);
  std::vector<Eigen::Matrix3d> principal;
  principal.reserve(scatter.size());
  for (const Eigen::Matrix3d& scatter_matrix : scatter)
    principal.push_back(
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(scatter_matrix).eigenvectors());
  // Extents are measured along the axes: the square roots of the scatter matrix' eigenvalues would
  // have only half the digits.
  RowMatrix extents = RowMatrix::Zero(region.handle_count, 3);
  for (int v : region.handle_vertices) {
    const int h = region.role[v];
    extents.row(h) = extents.row(h).cwiseMax((arm(v) * principal[h]).cwiseAbs());
  }
  for (int h = 0; h < region.handle_count; ++h) {
    Axes axes(3, 0);
    for (int k = 0; k < 3; ++k) {
      if (!(extents(h, k) > kMinHandleExtent)) continue;
      axes.conservativeResize(3, axes.cols() + 1);
      axes.rightCols<1>() = principal[h].col(k);
    }
    if (axes.cols() == 3) axes.setIdentity();
    begin_.push_back(begin_.back() + static_cast<int>(axes.cols()) + 1);
    axes_.push_back(axes);
  }
}

Eigen::Matrix<double, 1, Eigen::Dynamic, Eigen::RowMajor, 1, 4> HandleCoordinates::at(
    const Eigen::RowVector3d& position, int handle) const {
  Eigen::Matrix<double, 1, Eigen::Dynamic, Eigen::RowMajor, 1, 4> values(count(handle));
  values.head(count(handle) - 1) = (position - centres_.row(handle)) * axes_[handle];
  values[count(handle) - 1] = 1;
  return values;
}

HandleCoordinates::Reduction HandleCoordinates::reduction(int handle) const {
  Reduction result = Reduction::Zero(count(handle), 4);
  result.topLeftCorner(count(handle) - 1, 3) = axes_[handle].transpose();
  result(count(handle) - 1, 3) = 1;
  return result;
}

RowMatrix HandleCoordinates::reduced(const RowMatrix& coefficients) const {
  RowMatrix result(count(), coefficients.cols());
  for (int h = 0; h + 1 < static_cast<int>(begin_.size()); ++h)
    result.middleRows(begin(h), count(h)) = reduction(h) * coefficients.middleRows<4>(4 * Index(h));
  return result;
}

}  // namespace dd
