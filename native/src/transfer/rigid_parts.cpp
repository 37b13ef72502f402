// SPDX-License-Identifier: GPL-3.0-or-later
#include "transfer/rigid_parts.h"

#include <utility>

#include "mesh/triangles.h"
#include "support/rotations.h"

namespace dd {

namespace {

// Weight of the gradients over that of the places: κ Σ area_j / Σ m_i |p_i − p̄|².
constexpr double kGradientWeight = 1e-3;

}  // namespace

RigidParts::RigidParts(const TransferContext& context)
    : source_(*context.source),
      target_(*context.target),
      points_(*context.points),
      placement_(*context.placement),
      gradients_(*context.gradients),
      fans_(target_.triangles, target_.vertex_count()),
      areas_(triangle_areas(target_.positions, target_.triangles)) {
  for (const Component& component : *context.components) {
    if (component.held || component.triangles.empty()) continue;
    RigidPart part{component};
    for (int j : component.triangles) part.area += areas_[j];
    double sum = 0;
    for (int v : component.vertices) {
      double mass = 0;
      if (points_.is_known(v))
        for (int j : fans_.of(v)) mass += areas_[j] / 3;
      part.masses.push_back(mass);
      part.centre += mass * target_.positions.row(v).transpose();
      sum += mass;
    }
    if (!(sum > 0)) continue;
    part.centre /= sum;
    for (size_t i = 0; i < component.vertices.size(); ++i)
      part.squared_extent +=
          part.masses[i] *
          (target_.positions.row(component.vertices[i]).transpose() - part.centre).squaredNorm();
    parts_.push_back(std::move(part));
  }
}

void RigidParts::correct(const Positions& pose, Positions& result) {
  for (const RigidPart& part : parts_) {
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
    for (int j : part.component.triangles)
      covariance +=
          kGradientWeight * part.squared_extent * areas_[j] / part.area * gradients_.at(j);
    Eigen::Vector3d goal_centre = Eigen::Vector3d::Zero();
    double sum = 0;
    for (size_t i = 0; i < part.masses.size(); ++i) {
      if (!(part.masses[i] > 0)) continue;
      const int v = part.component.vertices[i];
      const Eigen::Vector3d p = target_.positions.row(v).transpose();
      const Eigen::Vector3d goal =
          placement_(points_.at(pose, v)) +
          gradients_.mean_of(fans_.of(v)) * (p - placement_(points_.at(source_.positions, v)));
      goal_centre += part.masses[i] * goal;
      covariance += part.masses[i] * goal * (p - part.centre).transpose();
      sum += part.masses[i];
    }
    goal_centre /= sum;
    const Eigen::Matrix3d rotation = polar_rotation(covariance);
    for (int v : part.component.vertices)
      result.row(v) =
          (goal_centre + rotation * (target_.positions.row(v).transpose() - part.centre))
              .transpose();
  }
}

}  // namespace dd
