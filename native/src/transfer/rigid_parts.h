// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "reconstruction/components.h"
#include "transfer/place_correction.h"
#include "transfer/source_gradients.h"
#include "transfer/source_points.h"

namespace dd {

/// Loose parts of a target that keep their shape, as buttons, armour and glasses do: each goes by
/// the rotation R and the shift that bring its vertices p_i next to where the source asks them to
/// be, g_i = A(b'_i) + S_i (p_i − A(b_i)), and turn as its triangles' gradients do,
///
///   R = argmax tr(Rᵀ (Σ_i m_i (g_i − ḡ)(p_i − p̄)ᵀ + κ Σ_j area_j S_j)),
///
/// with κ so small that gradients decide where places leave a turn open, as of what is thin.
class RigidParts : public PlaceCorrection {
 public:
  /// components: of the target; those with sources that nothing holds follow. All must outlive
  /// this.
  RigidParts(const Mesh& source, const Mesh& target, const std::vector<Component>& components,
             const SourcePoints& points, const Similarity& placement,
             const SourceGradients& gradients);

  /// pose: S', whose gradients were taken. result: T'; such parts are put in place.
  void correct(const Positions& pose, Positions& result) override;

 private:
  struct Part {
    const Component& component;
    std::vector<double> masses;  // of its vertices, zero where no point is known
    double area;
    Eigen::Vector3d centre;
    double spread;  // Σ m_i |p_i − p̄|²
  };
  const Mesh &source_, &target_;
  const SourcePoints& points_;
  const Similarity& placement_;
  const SourceGradients& gradients_;
  Fans fans_;
  Eigen::VectorXd areas_;
  std::vector<Part> parts_;
};

}  // namespace dd
