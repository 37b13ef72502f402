// SPDX-License-Identifier: GPL-3.0-or-later
#include "deform/deformer.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "methods/displacement_volumes.h"
#include "methods/examples/examples.h"
#include "methods/gradient_editing.h"
#include "methods/normal_displacement.h"
#include "methods/transfer.h"
#include "methods/variational.h"
#include "surface/floating_parts.h"

namespace dd {

namespace {

constexpr int kLeastRange = 1024;  // rows that are worth a task

void validate_example(const Positions& example, int number, const Mesh& mesh) {
  const std::string name = "Example " + std::to_string(number);
  if (example.rows() != mesh.vertex_count())
    throw Error(Status::argument, name + " has " + std::to_string(example.rows()) +
                                      " vertices, the mesh " + std::to_string(mesh.vertex_count()) +
                                      ": examples are poses of the same vertices.");
  for (Index v = 0; v < example.rows(); ++v)
    if (!(example.row(v).cwiseAbs().maxCoeff() <= kFarthest) || !example.row(v).allFinite())
      throw Error(Status::argument, name + ": vertex " + std::to_string(v) +
                                        " has a coordinate that is not finite or too far away to "
                                        "compute with. Move that vertex.");
}

Mesh validated(Mesh mesh) {
  validate(mesh);
  return mesh;
}

}  // namespace

Deformer::Deformer(Mesh mesh, const std::vector<int>& roles, int handle_count,
                   const BindOptions& options, const Progress& progress)
    : workers_(options.threads),
      bind_options_{options.base_metric,
                    options.metric_smoothing,
                    options.smoothness,
                    {},
                    options.precision,
                    options.threads,
                    {}},
      mesh_(validated(std::move(mesh))),
      region_(split_region(mesh_, roles, handle_count,
                           options.base.size() ? MovedBy::base : MovedBy::handles)) {
  report(progress, 0.02, "Building operators");
  scale_ = bounding_box_diagonal(mesh_.positions);
  centre_ = 0.5 * (mesh_.positions.colwise().maxCoeff() + mesh_.positions.colwise().minCoeff());
  BindOptions in_unit = options;
  in_unit.base = to_unit(options.base);
  for (size_t i = 0; i < options.examples.size(); ++i) {
    validate_example(options.examples[i], static_cast<int>(i), mesh_);
    in_unit.examples[i] = to_unit(options.examples[i]);
  }
  bound_ = std::make_unique<BoundSurface>(Mesh{to_unit(mesh_.positions), mesh_.triangles}, region_,
                                          in_unit, workers_, progress);
  if (!region_.grounds.empty()) floating_ = std::make_unique<FloatingParts>(*bound_);

  coefficients_ = RowMatrix::Zero(4 * handle_count, 4);
  linear_.assign(static_cast<size_t>(handle_count), Eigen::Matrix3d::Identity());
  base_ = bound_->rest_base;
  moved_ = Rows::Zero(base_.rows(), 4);
  offsets_ = Positions::Zero(mesh_.vertex_count(), 3);
  report(progress, 1.0, "Done");
}

Deformer::~Deformer() = default;

const Positions& Deformer::update(const double* matrices, const UpdateOptions& options,
                                  const Positions* deformed_base) {
  move(matrices, options, deformed_base);
  scale_to_mesh(moved_, offsets_);
  return offsets_;
}

void Deformer::update_to(float* out, bool positions, const double* matrices,
                         const UpdateOptions& options, const Positions* deformed_base) {
  move(matrices, options, deformed_base);
  const std::vector<int>& vertex = bound_->order().vertex_of_row;
  std::atomic<bool> fits{true};
  workers_.over(moved_.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
    double largest = 0, sum = 0;
    for (int64_t r = begin; r < end; ++r) {
      const int v = vertex[r];
      for (int c = 0; c < 3; ++c) {
        const double offset = scale_ * moved_(r, c);
        const double value = positions ? mesh_.positions(v, c) + offset : offset;
        largest = std::max(largest, std::abs(value));
        sum += value;
        out[3 * static_cast<size_t>(v) + c] = static_cast<float>(value);
      }
    }
    // A sum finds what is not a number, which no comparison does.
    if (!std::isfinite(sum) || largest > 0.5 * std::numeric_limits<float>::max()) fits = false;
  });
  if (!fits) throw leaves_single_precision();
}

void Deformer::move(const double* matrices, const UpdateOptions& options,
                    const Positions* deformed_base) {
  take_matrices(matrices);
  const RowOrder& order = bound_->order();
  for (int r = order.free_count; r < order.fixed_begin; ++r) {
    const int h = region_.role[order.vertex_of_row[r]];
    const Eigen::RowVector3d arm = bound_->rest.row(r).head<3>() - bound_->basis.centres.row(h);
    moved_.row(r) = arm * coefficients_.middleRows<3>(4 * h) + coefficients_.row(4 * h + 3);
  }
  moved_.bottomRows(order.count() - order.fixed_begin).setZero();
  move_base(deformed_base);
  if (options.shown == Shown::base) {
    moved_ = base_ - bound_->rest;
    return;
  }
  method(options).update({coefficients_, linear_, base_, moved_}, options.of_method);
  const bool from_gradients =
      options.method == MethodKind::transfer || options.method == MethodKind::gradient;
  if (floating_ && from_gradients) floating_->settle(base_, moved_);
}

void Deformer::move_base(const Positions* deformed) {
  const RowOrder& order = bound_->order();
  if (bound_->outside_base()) {
    if (!deformed || deformed->rows() != mesh_.vertex_count())
      throw Error(Status::argument,
                  "This surface was bound to a base from outside, and the update "
                  "has no deformed base with as many vertices.");
    if (!deformed->allFinite())
      throw Error(Status::argument, "The deformed base has coordinates that are not finite.");
    base_ = in_order(to_unit(*deformed), order);
    return;
  }
  const RowMatrix& weights = bound_->basis.weights;
  workers_.over(order.free_count, kLeastRange, [&](int64_t begin, int64_t end) {
    kernels().blend(static_cast<int>(end - begin), static_cast<int>(weights.cols()),
                    weights.row(begin).data(), coefficients_.data(),
                    bound_->rest_base.row(begin).data(), base_.row(begin).data());
  });
  const int held = order.fixed_begin - order.free_count;
  base_.middleRows(order.free_count, held) = bound_->rest_base.middleRows(order.free_count, held) +
                                             moved_.middleRows(order.free_count, held);
}

void Deformer::take_matrices(const double* matrices) {
  using Affine = Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>;
  for (int h = 0; h < region_.handle_count; ++h) {
    const Affine matrix(matrices + 12 * static_cast<Index>(h));
    if (!matrix.allFinite())
      throw Error(Status::argument,
                  "The matrix of handle " + std::to_string(h) + " is not finite.");
    linear_[h] = matrix.leftCols<3>();
    const Eigen::Matrix3d change = linear_[h] - Eigen::Matrix3d::Identity();
    const Eigen::RowVector3d centre = scale_ * bound_->basis.centres.row(h) + centre_;
    const Eigen::Vector3d shift = change * centre.transpose() + matrix.col(3);
    coefficients_.block<3, 3>(4 * h, 0) = change.transpose();
    coefficients_.block<1, 3>(4 * h + 3, 0) = shift.transpose() / scale_;
  }
}

Method& Deformer::method(const UpdateOptions& options) {
  std::unique_ptr<Method>& made = methods_[static_cast<int>(options.method)];
  switch (options.method) {
    case MethodKind::transfer:
      if (!made) made = make_transfer(*bound_);
      break;
    case MethodKind::variational:
      if (!made) made = std::make_unique<Variational>(*bound_);
      break;
    case MethodKind::gradient:
      if (!made) made = std::make_unique<GradientEditing>(*bound_);
      break;
    case MethodKind::normal:
      if (!made || static_cast<NormalDisplacement&>(*made).levels() != options.of_method.levels)
        made = std::make_unique<NormalDisplacement>(*bound_, options.of_method.levels);
      break;
    case MethodKind::volumes:
      if (!made) made = std::make_unique<DisplacementVolumes>(*bound_, options.of_method.progress);
      break;
    case MethodKind::examples:
      if (!made) made = make_examples(*bound_);
      break;
  }
  return *made;
}

void Deformer::scale_to_mesh(const Rows& rows, Positions& vectors) const {
  const std::vector<int>& vertex = bound_->order().vertex_of_row;
  double sum = 0;
  for (Index r = 0; r < rows.rows(); ++r) {
    for (int c = 0; c < 3; ++c) vectors(vertex[r], c) = scale_ * rows(r, c);
    sum += std::abs(rows(r, 0)) + std::abs(rows(r, 1)) + std::abs(rows(r, 2));
  }
  if (!std::isfinite(sum))
    throw Error(Status::numeric,
                "The handles' matrices are too large: the deformed surface is not finite.");
}

Positions Deformer::place_in_mesh(const Rows& rows) const {
  Positions positions(rows.rows(), 3);
  scale_to_mesh(rows, positions);
  return positions.rowwise() + centre_;
}

Positions Deformer::to_unit(const Positions& positions) const {
  return (positions.rowwise() - centre_) / scale_;
}

Positions Deformer::base() const { return place_in_mesh(bound_->rest_base); }

Positions Deformer::deformed_base() const { return place_in_mesh(base_); }

int Deformer::borrowed_count() const {
  const auto& made = methods_[static_cast<int>(MethodKind::transfer)];
  return made ? static_cast<const TransferMethod&>(*made).borrowed_count() : 0;
}

const NormalDisplacement* Deformer::normal_displacement() const {
  return static_cast<const NormalDisplacement*>(
      methods_[static_cast<int>(MethodKind::normal)].get());
}

const DisplacementVolumes* Deformer::displacement_volumes() const {
  return static_cast<const DisplacementVolumes*>(
      methods_[static_cast<int>(MethodKind::volumes)].get());
}

std::vector<double> Deformer::example_weights() const {
  const auto& made = methods_[static_cast<int>(MethodKind::examples)];
  if (!made) return std::vector<double>(bound_->examples.size(), 0);
  const Eigen::VectorXd& weights = static_cast<const ExamplesMethod&>(*made).weights();
  return {weights.begin(), weights.end()};
}

double Deformer::bytes() const {
  const auto doubles = mesh_.positions.size() + offsets_.size() + coefficients_.size() +
                       base_.size() + moved_.size();
  const auto ints = mesh_.triangles.size() +
                    static_cast<Index>(region_.role.size() + region_.row.size() +
                                       region_.free.size() + region_.handle_vertices.size());
  double sum = static_cast<double>(doubles) * sizeof(double) +
               static_cast<double>(ints) * sizeof(int) + bound_->bytes();
  for (const auto& made : methods_)
    if (made) sum += made->bytes();
  return sum;
}

}  // namespace dd
