// SPDX-License-Identifier: GPL-3.0-or-later
#include "deformer.h"

#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include "base_surface.h"

namespace dd {

namespace {

Mesh validated(Mesh mesh) {
  validate(mesh);
  return mesh;
}

}  // namespace

Deformer::Deformer(Mesh mesh, const std::vector<int>& roles, int handle_count,
                   const BindOptions& options, const Progress& progress)
    : mesh_(validated(std::move(mesh))), region_(split_region(mesh_, roles, handle_count)) {
  report(progress, 0.02, "Building operators");
  scale_ = bounding_box_diagonal(mesh_.positions);
  centre_ = 0.5 * (mesh_.positions.colwise().maxCoeff() + mesh_.positions.colwise().minCoeff());
  const Mesh unit = {(mesh_.positions.rowwise() - centre_) / scale_, mesh_.triangles};
  const SurfaceOperators on_surface = surface_operators(unit.positions, unit.triangles);

  // The geometry that the bi-Laplacian is built on, where it isn't S itself.
  std::optional<SurfaceOperators> elsewhere;
  if (options.base_metric == BaseMetric::surface && options.metric_smoothing > 0)
    elsewhere = surface_operators(faired_surface(unit, on_surface, options.metric_smoothing),
                                  unit.triangles);
  report(progress, 0.1, "Factoring the bi-Laplacian");
  auto bending = std::make_unique<BendingSystem>(elsewhere ? *elsewhere : on_surface, region_);
  report(progress, 0.5, "Computing the base surface");
  base_ = base_surface(*bending, region_, unit.positions);
  if (options.base_metric == BaseMetric::base) {
    report(progress, 0.55, "Factoring the bi-Laplacian of the base");
    bending.reset();
    elsewhere = surface_operators(base_, unit.triangles);
    bending = std::make_unique<BendingSystem>(*elsewhere, region_);
  }
  report(progress, 0.75, "Computing the handles' basis functions");
  const HandleBasis basis = handle_basis(*bending, region_, unit.positions);
  bending.reset();

  report(progress, 0.85, "Factoring the Poisson system");
  transfer_ = std::make_unique<Transfer>(Transfer::Input{unit, region_, on_surface, base_, basis});
  degenerate_ = on_surface.metric.degenerate;

  handle_centres_ = from_unit(basis.centres);
  coefficients_ = RowMatrix::Zero(4 * handle_count, 4);
  handle_offsets_ = RowMatrix::Zero(static_cast<Index>(region_.handle_vertices.size()), 4);
  offsets_ = Positions::Zero(mesh_.vertex_count(), 3);
  report(progress, 1.0, "Done");
}

const Positions& Deformer::update(const double* matrices, bool rotation_only) {
  using Affine = Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>;
  for (int h = 0; h < region_.handle_count; ++h) {
    const Affine matrix(matrices + 12 * static_cast<Index>(h));
    if (!matrix.allFinite())
      throw Error(Status::argument,
                  "The matrix of handle " + std::to_string(h) + " is not finite.");
    Eigen::Matrix3d change = matrix.leftCols<3>();
    change -= Eigen::Matrix3d::Identity();
    const Eigen::Vector3d shift = change * handle_centres_.row(h).transpose() + matrix.col(3);
    coefficients_.block<3, 3>(4 * h, 0) = change.transpose();
    coefficients_.block<1, 3>(4 * h + 3, 0) = shift.transpose() / scale_;
  }

  for (Index k = 0; k < handle_offsets_.rows(); ++k) {
    const int v = region_.handle_vertices[k], h = region_.role[v];
    const Eigen::RowVector3d arm = (mesh_.positions.row(v) - handle_centres_.row(h)) / scale_;
    handle_offsets_.row(k) =
        arm * coefficients_.middleRows<3>(4 * h) + coefficients_.row(4 * h + 3);
    offsets_.row(v) = scale_ * handle_offsets_.row(k).head<3>();
  }
  transfer_->update(coefficients_.data(), handle_offsets_.data(), rotation_only);

  const auto& vertices = transfer_->vertex_of_row();
  const double* rows = transfer_->offsets();
  double sum = 0;
  for (size_t r = 0; r < vertices.size(); ++r) {
    for (int c = 0; c < 3; ++c) offsets_(vertices[r], c) = scale_ * rows[4 * r + c];
    sum += std::abs(rows[4 * r]) + std::abs(rows[4 * r + 1]) + std::abs(rows[4 * r + 2]);
  }
  if (!std::isfinite(sum))
    throw Error(Status::numeric,
                "The handles' matrices are too large: the deformed surface is not finite.");
  return offsets_;
}

Positions Deformer::deformed_base() const {
  Positions deformed = base_;
  for (Index k = 0; k < handle_offsets_.rows(); ++k)
    deformed.row(region_.handle_vertices[k]) += handle_offsets_.row(k).head<3>();
  for (int r = 0; r < region_.free_count(); ++r)
    deformed.row(transfer_->vertex_of_row()[r]) = transfer_->deformed_base_row(r);
  return from_unit(deformed);
}

Positions Deformer::from_unit(const Positions& unit) const {
  return (scale_ * unit).rowwise() + centre_;
}

double Deformer::bytes() const {
  const auto doubles = mesh_.positions.size() + base_.size() + offsets_.size() +
                       coefficients_.size() + handle_offsets_.size();
  const auto ints = mesh_.triangles.size() +
                    static_cast<Index>(region_.role.size() + region_.row.size() +
                                       region_.free.size() + region_.handle_vertices.size());
  return static_cast<double>(doubles) * sizeof(double) + static_cast<double>(ints) * sizeof(int) +
         transfer_->bytes();
}

}  // namespace dd
