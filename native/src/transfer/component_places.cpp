// SPDX-License-Identifier: GPL-3.0-or-later
#include "transfer/component_places.h"

#include "mesh/triangles.h"

namespace dd {

ComponentPlaces::ComponentPlaces(const TransferContext& context, const Eigen::VectorXd& areas,
                                 const Displacements* displacements)
    : target_(*context.target),
      components_(*context.components),
      areas_(areas),
      placement_(*context.placement),
      gradients_(*context.gradients),
      displacements_(displacements),
      pool_(*context.pool),
      source_centres_(Positions::Zero(target_.triangle_count(), 3)) {
  std::vector<size_t> counts;
  for (const Component& component : components_) {
    counts.push_back(component.triangles.size());
    for (int j : component.triangles)
      source_centres_.row(j) =
          gradients_.centre_of_sources(context.source->positions, j).transpose();
  }
  triangle_sums_ = PartSums(counts);
}

void ComponentPlaces::correct(const Positions& pose, Positions& result) {
  struct Sums {
    MeanShift residuals, shifts;
    void operator+=(const Sums& other) {
      residuals.add(other.residuals);
      shifts.add(other.shifts);
    }
  };
  const auto add = [&](Sums& sums, size_t component, size_t i) {
    const int j = components_[component].triangles[i];
    const Eigen::Vector3d target_centre = triangle_centre(target_.positions, target_.triangles, j);
    const Eigen::Matrix3d& S = gradients_.at(j);
    const Eigen::Vector3d rest_centre = source_centres_.row(j).transpose();
    const Eigen::Vector3d posed_centre = gradients_.centre_of_sources(pose, j);
    const Eigen::Vector3d goal =
        displacements_ ? Eigen::Vector3d(target_centre +
                                         displacements_->displacement(rest_centre, posed_centre))
                       : Eigen::Vector3d(placement_(posed_centre) +
                                         S * (target_centre - placement_(rest_centre)));
    const double weight = areas_[j] * stillness(S, Eigen::Matrix3d::Identity());
    sums.residuals.add(weight, (goal - triangle_centre(result, target_.triangles, j)).transpose());
    sums.shifts.add(weight, (goal - target_centre).transpose());
  };
  const std::vector<Sums> of_components = triangle_sums_.of<Sums>(pool_, add);
  Sums of_all;
  MeanShift of_pinned;
  for (size_t i = 0; i < components_.size(); ++i) {
    of_all += of_components[i];
    if (components_[i].held) of_pinned.add(of_components[i].residuals);
  }
  for (size_t i = 0; i < components_.size(); ++i) {
    if (components_[i].held) continue;
    // A component without a source of its own moves by the mean of the others.
    const Eigen::RowVector3d shift =
        components_[i].triangles.empty() ? of_all.shifts.mean() : of_components[i].residuals.mean();
    for (int v : components_[i].vertices) result.row(v) += shift;
  }
  mean_residual_of_pinned_ = of_pinned.mean();
}

void KeptTogether::correct(const Positions&, Positions& result) {
  const Eigen::RowVector3d& residual = places_.mean_residual_of_pinned();
  if (residual.isZero(0)) return;
  for (const Component& component : components_)
    if (!component.held)
      for (int v : component.vertices) result.row(v) -= residual;
}

}  // namespace dd
