// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "surface/bound_surface.h"
#include "surface/gradients.h"

namespace dd {

/// A loose part of the surface. Deformation gradients leave its place open unless it is held.
struct Component {
  std::vector<int> vertices;   ///< those that aren't fixed
  std::vector<int> triangles;  ///< all
  bool held = false;           ///< by a vertex that isn't free
};

/// The components with a vertex that isn't fixed, by their lowest one.
std::vector<Component> movable_components(const Mesh& mesh, const Region& region);

/// Where weighted points are, and where they should be on the mean.
struct Misplacement {
  Eigen::RowVector3d sum = Eigen::RowVector3d::Zero();
  double weight = 0;

  void add(double w, const Eigen::RowVector3d& missing) {
    sum += w * missing;
    weight += w;
  }
  void add(const Misplacement& other) {
    sum += other.sum;
    weight += other.weight;
  }
  /// The shift that puts their mean in place; none where nothing has a weight.
  Eigen::RowVector3d shift() const {
    return weight > 0 ? Eigen::RowVector3d(sum / weight) : Eigen::RowVector3d::Zero();
  }
};

/// Components that nothing holds, carried by a base from outside: each keeps its mean place
/// relative to its base,
///
///   Σ_j A_j c'_j = Σ_j A_j (b'_j + R_j (c_j − b_j))
///
/// with c_j, b_j the centres of triangle j on S and on B, A_j its area on S, R_j its base's
/// rotation.
class CarriedComponents {
 public:
  explicit CarriedComponents(const BoundSurface& bound);

  /// base: B', all rows. offsets: the displacement of S, shifted as a whole in each such component.
  void place(const Rows& base, Rows& offsets);

 private:
  struct Carried {
    std::vector<int> rows;
    std::vector<int> triangles;  // indices into what follows
  };
  const BoundSurface& bound_;
  std::vector<Carried> components_;
  Triangles triangles_;  // with rows for corners
  std::vector<double> areas_;
  Positions arms_;  // c_j − b_j
  std::vector<RotationBlock<double>> blocks_;
  Rows rotations_;
};

}  // namespace dd
