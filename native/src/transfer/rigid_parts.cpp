// SPDX-License-Identifier: GPL-3.0-or-later
#include "transfer/rigid_parts.h"

#include <utility>

#include "mesh/triangles.h"
#include "support/rotations.h"

namespace dd {

namespace {

// Weight of the gradients over that of the places: κ Σ area_j / Σ m_i |p_i − p̄|².
constexpr double kTurnsByGradients = 1e-3;

}  // namespace

RigidParts::RigidParts(const Mesh& source, const Mesh& target,
                       const std::vector<Component>& components, const SourcePoints& points,
                       const Similarity& placement, const SourceGradients& gradients)
    : source_(source),
      target_(target),
      points_(points),
      placement_(placement),
      gradients_(gradients),
      fans_(target.triangles, target.vertex_count()),
      areas_(triangle_areas(target.positions, target.triangles)) {
  for (const Component& component : components) {
    if (component.held || component.triangles.empty()) continue;
    Part part{component, {}, 0, Eigen::Vector3d::Zero(), 0};
    for (int j : component.triangles) part.area += areas_[j];
    double sum = 0;
    for (int v : component.vertices) {
      double mass = 0;
      if (points_.is_known(v))
        for (int j : fans_.of(v)) mass += areas_[j] / 3;
      part.masses.push_back(mass);
      part.centre += mass * target.positions.row(v).transpose();
      sum += mass;
    }
    if (!(sum > 0)) continue;
    part.centre /= sum;
    for (size_t i = 0; i < component.vertices.size(); ++i)
      part.spread +=
          part.masses[i] *
          (target.positions.row(component.vertices[i]).transpose() - part.centre).squaredNorm();
    parts_.push_back(std::move(part));
  }
}

void RigidParts::correct(const Positions& pose, Positions& result) {
  for (const Part& part : parts_) {
    Eigen::Matrix3d turn = Eigen::Matrix3d::Zero();
    for (int j : part.component.triangles)
      turn += kTurnsByGradients * part.spread * areas_[j] / part.area * gradients_.at(j);
    Eigen::Vector3d there = Eigen::Vector3d::Zero();
    double sum = 0;
    for (size_t i = 0; i < part.masses.size(); ++i) {
      if (!(part.masses[i] > 0)) continue;
      const int v = part.component.vertices[i];
      const Eigen::Vector3d p = target_.positions.row(v).transpose();
      const Eigen::Vector3d wanted =
          placement_(points_.at(pose, v)) +
          gradients_.mean_of(fans_.of(v)) * (p - placement_(points_.at(source_.positions, v)));
      there += part.masses[i] * wanted;
      turn += part.masses[i] * wanted * (p - part.centre).transpose();
      sum += part.masses[i];
    }
    there /= sum;
    const Eigen::Matrix3d rotation = polar_rotation(turn);
    for (int v : part.component.vertices)
      result.row(v) =
          (there + rotation * (target_.positions.row(v).transpose() - part.centre)).transpose();
  }
}

}  // namespace dd
