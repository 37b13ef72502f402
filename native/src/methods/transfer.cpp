// SPDX-License-Identifier: GPL-3.0-or-later
#include "transfer.h"

#include "../rotations.h"

namespace dd {

namespace {

/// For each loose part the handle that alone holds it, by two vertices or more; else -1.
std::vector<int> lone_handles(const Region& region, const Components& parts) {
  constexpr int kNone = -1;
  std::vector<int> handle(static_cast<size_t>(parts.count), kNone);
  std::vector<int> held(static_cast<size_t>(parts.count), 0);
  std::vector<char> mixed(static_cast<size_t>(parts.count), 0);
  for (size_t v = 0; v < region.role.size(); ++v) {
    const int role = region.role[v], part = parts.of_vertex[v];
    if (role == kFree) continue;
    if (held[part]++ == 0) handle[part] = role;
    mixed[part] |= handle[part] != role;
  }
  for (size_t part = 0; part < handle.size(); ++part)
    if (mixed[part] || held[part] < 2 || handle[part] < 0) handle[part] = kNone;
  return handle;
}

}  // namespace

Transfer::Transfer(BoundSurface& bound) : bound_(bound) {
  const Triangles& t = bound.mesh.triangles;
  const std::vector<int>& active = bound.poisson.active_triangles();
  const Positions flux = corner_divergence(bound.operators.metric, bound.mesh.positions, t);
  const GradientSources sources =
      gradient_sources(bound.base, t, bounding_box_diagonal(bound.mesh.positions));
  pass_ = GradientPass(bound.base, t, flux, active, sources, bound.order());
  std::vector<int> without_source;
  for (int j : active) {
    borrowed_count_ += sources.of_triangle[j] != j;
    if (sources.of_triangle[j] < 0) without_source.push_back(j);
  }
  if (!without_source.empty()) carry(without_source, flux);
}

void Transfer::carry(const std::vector<int>& triangles, const Positions& flux) {
  const Components parts = connected_components(bound_.mesh);
  const std::vector<int> handle_of_part = lone_handles(bound_.region, parts);
  for (int j : triangles) {
    const auto corner = bound_.mesh.triangles.row(j);
    Carried carried;
    carried.handle = handle_of_part[parts.of_vertex[corner[0]]];
    for (int k = 0; k < 3; ++k) carried.target[k] = bound_.order().target_of_vertex(corner[k]);
    carried.flux = flux.middleRows<3>(3 * Index(j)).transpose();
    carried_.push_back(carried);
  }
}

void Transfer::add_carried(const Frame& frame, bool rotation_only, double* rows) const {
  if (carried_.empty()) return;
  std::vector<Eigen::Matrix3d> gradients = frame.linear;
  if (rotation_only)
    for (Eigen::Matrix3d& gradient : gradients) gradient = polar_rotation(gradient);
  for (const Carried& carried : carried_) {
    const Eigen::Matrix3d turned = carried.handle < 0
                                       ? carried.flux
                                       : Eigen::Matrix3d(gradients[carried.handle] * carried.flux);
    for (int k = 0; k < 3; ++k)
      Eigen::Map<Eigen::Vector3d>(rows + 4 * Index(carried.target[k])) += turned.col(k);
  }
}

void Transfer::update_volumetrically(const Frame& frame, const MethodOptions& options) {
  if (volumetric_as_ != options.formulation) {
    volumetric_.reset();
    volumetric_ = std::make_unique<VolumetricTransfer>(
        bound_, options.formulation == Formulation::fourth_points ? FourthPointWeights::volumes
                                                                  : FourthPointWeights::ones);
    volumetric_as_ = options.formulation;
  }
  volumetric_->update(frame.base, frame.offsets, options.rotation_only);
}

void Transfer::update(const Frame& frame, const MethodOptions& options) {
  if (options.formulation != Formulation::surface) return update_volumetrically(frame, options);
  double* rows = bound_.poisson.start(frame.offsets);
  pass_.add_to(rows, frame.base.data(), options.rotation_only);
  add_carried(frame, options.rotation_only, rows);
  bound_.poisson.solve(frame.offsets);
  if (!options.rotation_only || options.refine == 0) return;
  if (!refinement_) refinement_ = std::make_unique<Refinement>(bound_);
  refinement_->run(options.refine, frame.offsets);
}

double Transfer::bytes() const {
  return pass_.bytes() + static_cast<double>(carried_.size() * sizeof(Carried)) +
         (refinement_ ? refinement_->bytes() : 0) + (volumetric_ ? volumetric_->bytes() : 0);
}

}  // namespace dd
