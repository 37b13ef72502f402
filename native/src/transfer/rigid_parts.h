// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "reconstruction/components.h"
#include "transfer/place_correction.h"
#include "transfer/source_gradients.h"
#include "transfer/source_points.h"
#include "transfer/transfer_context.h"

namespace dd {

/// Moves loose parts of a target rigidly, such as buttons, armour and glasses. The rotation R and
/// the shift of a part fit its vertices p_i to their goals g_i = A(b'_i) + S_i (p_i − A(b_i)), and
/// R fits its triangles' gradients, too,
///
///   R = argmax tr(Rᵀ (Σ_i m_i (g_i − ḡ)(p_i − p̄)ᵀ + κ Σ_j area_j S_j)).
///
/// κ is small: gradients decide only where places leave the rotation open, as of thin parts.
class RigidParts : public PlaceCorrection {
 public:
  /// Of the components those that have sources and aren't held are moved.
  explicit RigidParts(const TransferContext& context);

  /// pose: S', which SourceGradients::set_pose() was called with. result: T', in which the parts
  /// are moved.
  void correct(const Positions& pose, Positions& result) override;

 private:
  struct RigidPart {
    const Component& component;
    std::vector<double> masses = {};  // of its vertices, zero without a known source point
    double area = 0;
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();
    double squared_extent = 0;  // Σ m_i |p_i − p̄|²
  };
  const Mesh &source_, &target_;
  const SourcePoints& points_;
  const Similarity& placement_;
  const SourceGradients& gradients_;
  VertexTriangles fans_;
  Eigen::VectorXd areas_;
  std::vector<RigidPart> parts_;
};

}  // namespace dd
