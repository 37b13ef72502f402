// SPDX-License-Identifier: GPL-3.0-or-later
#include "transfer/component_places.h"

#include "mesh/triangles.h"

namespace dd {

ComponentPlaces::ComponentPlaces(const Mesh& source, const Mesh& target,
                                 const std::vector<Component>& components,
                                 const Eigen::VectorXd& areas, const Similarity& placement,
                                 const SourceGradients& gradients,
                                 const Displacements* displacements, ThreadPool& pool)
    : target_(target),
      components_(components),
      areas_(areas),
      placement_(placement),
      gradients_(gradients),
      displacements_(displacements),
      pool_(pool),
      source_centres_(Positions::Zero(target.triangle_count(), 3)) {
  std::vector<size_t> counts;
  for (const Component& component : components) {
    counts.push_back(component.triangles.size());
    for (int j : component.triangles)
      source_centres_.row(j) = gradients.centre_of_sources(source.positions, j).transpose();
  }
  over_triangles_ = PartSums(counts);
}

void ComponentPlaces::correct(const Positions& pose, Positions& result) {
  struct Sums {
    MeanShift missing, moved;
    void operator+=(const Sums& other) {
      missing.add(other.missing);
      moved.add(other.moved);
    }
  };
  const auto add = [&](Sums& sums, size_t component, size_t i) {
    const int j = components_[component].triangles[i];
    const Eigen::Vector3d own = triangle_centre(target_.positions, target_.triangles, j);
    const Eigen::Matrix3d& S = gradients_.at(j);
    const Eigen::Vector3d before = source_centres_.row(j).transpose();
    const Eigen::Vector3d now = gradients_.centre_of_sources(pose, j);
    const Eigen::Vector3d wanted =
        displacements_ ? Eigen::Vector3d(own + displacements_->way(before, now))
                       : Eigen::Vector3d(placement_(now) + S * (own - placement_(before)));
    const double weight = areas_[j] * stillness(S, Eigen::Matrix3d::Identity());
    sums.missing.add(weight, (wanted - triangle_centre(result, target_.triangles, j)).transpose());
    sums.moved.add(weight, (wanted - own).transpose());
  };
  const std::vector<Sums> of_components = over_triangles_.of<Sums>(pool_, add);
  Sums of_all;
  MeanShift of_pinned;
  for (size_t i = 0; i < components_.size(); ++i) {
    of_all += of_components[i];
    if (components_[i].held) of_pinned.add(of_components[i].missing);
  }
  for (size_t i = 0; i < components_.size(); ++i) {
    if (components_[i].held) continue;
    // A component without a source of its own moves by the mean of the others.
    const Eigen::RowVector3d shift =
        components_[i].triangles.empty() ? of_all.moved.mean() : of_components[i].missing.mean();
    for (int v : components_[i].vertices) result.row(v) += shift;
  }
  lacked_by_pinned_ = of_pinned.mean();
}

void KeptTogether::correct(const Positions&, Positions& result) {
  const Eigen::RowVector3d& lacked = places_.lacked_by_pinned();
  if (lacked.isZero(0)) return;
  for (const Component& component : components_)
    if (!component.held)
      for (int v : component.vertices) result.row(v) -= lacked;
}

}  // namespace dd
