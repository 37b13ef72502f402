// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mesh/aabb_tree.h"

namespace dd {

/// A mesh's loose parts, the largest of them told apart.
struct LooseParts {
  explicit LooseParts(const Mesh& mesh);

  int count = 0;
  std::vector<int> of_vertex;  ///< −1: of a small one
};

/// Which loose parts of two meshes may correspond: an eye to the other head's eye, teeth to teeth,
/// skin to skin, though an eyeball lies nearer to a lid than the other lid does. How far two are
/// apart is how far the one has to be moved to lie on the other, if each is as spread as the normal
/// distribution of its mean μ and covariance C (Wasserstein's distance),
///
///   d² = |μ − μ'|² + tr(C + C' − 2 (C^½ C' C^½)^½),
///
/// and they may correspond if for either of them none is much nearer. So what is one part of one
/// mesh and several of the other may correspond to each of these, and so may small ones to all. But
/// where all parts are paired so that Σ d² is least, what is paired with its like, by shape, takes
/// no other's: in a row of teeth the next one is often nearer.
class PartPairs {
 public:
  /// In the space of both. All must outlive this.
  PartPairs(const Mesh& mesh, const LooseParts& parts, const Mesh& other,
            const LooseParts& parts_of_other);

  /// The point of the other mesh that is nearest to a point beside a vertex of the mesh, within
  /// reach, and whose normal is less than a right angle off; of what may correspond, unless that is
  /// far and something else isn't. tree: of the other mesh.
  PointOnTriangle nearest_facing(const AabbTree& tree, int vertex, const Eigen::Vector3d& point,
                                 const Eigen::Vector3d& normal, double reach) const;

 private:
  const Triangles& triangles_;  // of the other
  const std::vector<int>&own_, &others_;
  int count_;  // of the other's parts
  double near_;
  std::vector<char> may_;  // of each part of the mesh each of the other's; empty: all
};

}  // namespace dd
