// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "reconstruction/components.h"
#include "transfer/displacements.h"
#include "transfer/part_sums.h"
#include "transfer/place_correction.h"
#include "transfer/source_gradients.h"
#include "transfer/transfer_context.h"

namespace dd {

/// Shifts each component of T that nothing pins to where its source went: with A the placement,
/// b_j the centre of the sources of triangle j, c_j its own,
///
///   Σ_j w_j c'_j = Σ_j w_j (A(b'_j) + S_j (c_j − A(b_j))),   w_j = area_j / (ε² + ‖S_j − I‖²):
///
/// triangles that don't deform have most of the weight, so that the shoulders rest while the jaw
/// opens. With Displacements, A(b'_j) + S_j (c_j − A(b_j)) is replaced by c_j + s R (b'_j − b_j).
class ComponentPlaces : public PlaceCorrection {
 public:
  /// areas: of the target's triangles. displacements: or null. Both must outlive this.
  ComponentPlaces(const TransferContext& context, const Eigen::VectorXd& areas,
                  const Displacements* displacements);

  void correct(const Positions& pose, Positions& result) override;

  /// The mean shift that pinned components would need in the last pose.
  const Eigen::RowVector3d& mean_residual_of_pinned() const { return mean_residual_of_pinned_; }

 private:
  const Mesh& target_;
  const std::vector<Component>& components_;
  const Eigen::VectorXd& areas_;
  const Similarity& placement_;
  const SourceGradients& gradients_;
  const Displacements* displacements_;
  ThreadPool& pool_;
  PartSums triangle_sums_;
  Positions source_centres_;  // b_j, by triangle of the target
  Eigen::RowVector3d mean_residual_of_pinned_ = Eigen::RowVector3d::Zero();
};

/// Shifts the components that nothing pins by the opposite of the mean shift that the pinned ones
/// lack, so that all components of the target stay together.
class KeptTogether : public PlaceCorrection {
 public:
  /// Both must outlive this.
  KeptTogether(const std::vector<Component>& components, const ComponentPlaces& places)
      : components_(components), places_(places) {}

  void correct(const Positions& pose, Positions& result) override;

 private:
  const std::vector<Component>& components_;
  const ComponentPlaces& places_;
};

}  // namespace dd
