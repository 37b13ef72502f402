// SPDX-License-Identifier: GPL-3.0-or-later
#include "methods/transfer.h"

#include <algorithm>

#include "support/rotations.h"

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

template <class Real>
Transfer<Real>::Transfer(BoundSurface& bound) : bound_(bound) {
  const Triangles& t = bound.mesh.triangles;
  const Positions flux = corner_divergence(bound.operators.metric, bound.mesh.positions, t);
  const GradientSources sources =
      gradient_sources(bound.base, t, bounding_box_diagonal(bound.mesh.positions));
  pass_ = std::make_unique<GradientPass<Real>>(bound.base, t, flux, sources, *bound.poisson);
  std::vector<int> without_source;
  const ActiveTriangles& active = bound.poisson->active();
  for (int i = 0; i < active.size(); ++i) {
    const int j = active.triangles[i];
    borrowed_count_ += sources.of_triangle[j] != j;
    if (sources.of_triangle[j] < 0) without_source.push_back(i);
  }
  if (!without_source.empty()) carry(without_source, flux);
  for (bool rotation_only : {false, true}) at_rest_[rotation_only] = at_rest(rotation_only);
}

/// which: places in the active triangles.
template <class Real>
void Transfer<Real>::carry(const std::vector<int>& which, const Positions& flux) {
  const ActiveTriangles& active = bound_.poisson->active();
  const Components parts = connected_components(bound_.mesh);
  const std::vector<int> handle_of_part = lone_handles(bound_.region, parts);
  for (int i : which) {
    const int j = active.triangles[i];
    const auto corner = bound_.mesh.triangles.row(j);
    Carried carried;
    carried.handle = handle_of_part[parts.of_vertex[corner[0]]];
    carried.part = static_cast<int>(std::upper_bound(active.begin.begin(), active.begin.end(), i) -
                                    active.begin.begin() - 1);
    for (int k = 0; k < 3; ++k) carried.target[k] = bound_.poisson->target(carried.part, corner[k]);
    carried.flux = flux.middleRows<3>(3 * Index(j)).transpose();
    carried_.push_back(carried);
  }
}

template <class Real>
std::vector<Eigen::Matrix3d> Transfer<Real>::carrying_gradients(const Frame& frame,
                                                                bool rotation_only) const {
  if (carried_.empty()) return {};
  std::vector<Eigen::Matrix3d> gradients = frame.linear;
  if (rotation_only)
    for (Eigen::Matrix3d& gradient : gradients) gradient = polar_rotation(gradient);
  return gradients;
}

template <class Real>
void Transfer<Real>::add(int part, const Rows& base, bool rotation_only,
                         const std::vector<Eigen::Matrix3d>& carrying, double* rows) const {
  pass_->add(part, base.data(), rotation_only, rows);
  for (const Carried& carried : carried_) {
    if (carried.part != part) continue;
    const Eigen::Matrix3d turned = carried.handle < 0
                                       ? carried.flux
                                       : Eigen::Matrix3d(carrying[carried.handle] * carried.flux);
    for (int k = 0; k < 3; ++k)
      Eigen::Map<Eigen::Vector3d>(rows + 4 * Index(carried.target[k])) += turned.col(k);
  }
}

template <class Real>
Rows Transfer<Real>::at_rest(bool rotation_only) const {
  const std::vector<Eigen::Matrix3d> still(static_cast<size_t>(bound_.region.handle_count),
                                           Eigen::Matrix3d::Identity());
  Rows rows = Rows::Zero(bound_.poisson->right_hand_side_rows(), 4);
  for (int part = 0; part < bound_.poisson->active().parts(); ++part)
    add(part, bound_.rest_base, rotation_only, still, rows.data());
  return rows;
}

template <class Real>
void Transfer<Real>::update_volumetrically(const Frame& frame, const MethodOptions& options) {
  if (!volumetric_ || volumetric_as_ != options.formulation) {
    volumetric_.reset();  // first, so that two never take memory at once
    volumetric_ = std::make_unique<VolumetricTransfer>(
        bound_, options.formulation == Formulation::fourth_points ? FourthPointWeights::volumes
                                                                  : FourthPointWeights::ones);
    volumetric_as_ = options.formulation;
  }
  volumetric_->update(frame.base, frame.offsets, options.rotation_only);
}

template <class Real>
void Transfer<Real>::update(const Frame& frame, const MethodOptions& options) {
  if (options.formulation != Formulation::surface) return update_volumetrically(frame, options);
  const std::vector<Eigen::Matrix3d> carrying = carrying_gradients(frame, options.rotation_only);
  bound_.poisson->solve(
      at_rest_[options.rotation_only],
      [&](int part, double* rows) { add(part, frame.base, options.rotation_only, carrying, rows); },
      frame.offsets);
  if (!options.rotation_only || options.refine == 0) return;
  if (!refinement_) refinement_ = std::make_unique<Refinement<Real>>(bound_);
  refinement_->run(options.refine, frame.offsets);
}

template <class Real>
double Transfer<Real>::bytes() const {
  return pass_->bytes() + static_cast<double>(carried_.size() * sizeof(Carried)) +
         static_cast<double>((at_rest_[0].size() + at_rest_[1].size()) * Index(sizeof(double))) +
         (refinement_ ? refinement_->bytes() : 0) + (volumetric_ ? volumetric_->bytes() : 0);
}

template class Transfer<float>;
template class Transfer<double>;

std::unique_ptr<TransferMethod> make_transfer(BoundSurface& bound) {
  if (bound.poisson->precision() == Precision::single)
    return std::make_unique<Transfer<float>>(bound);
  return std::make_unique<Transfer<double>>(bound);
}

}  // namespace dd
