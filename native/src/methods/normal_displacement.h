// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mesh/topology.h"
#include "methods/method.h"

namespace dd {

/// VarMin with normal displacements (§1, Fig. 1c, 3 to 5, after Kobbelt et al.): S = B ⊕ D,
///
///   p = b + h · n(b)
///
/// b a point on B's triangles with interpolated vertex normals, found by projection. B moves to B',
/// and S' takes the same b and h there. With several levels S₀ = S, S₁, ..., S_k = B each surface
/// is smoother than the last, and displaced from the next.
///
/// The smooth surface draws in open borders of S: what then lies beyond hangs on the closest point
/// b of the border with p = b + F(b) d, F the frame of normal and border. A vertex without any b
/// near it hangs on its own vertex of the next surface in that manner. There S is not a height
/// field, and the representation fails; so it does where S folds back over the next surface and
/// several vertices share one b. These vertices are counted.
class NormalDisplacement : public Method {
 public:
  explicit NormalDisplacement(const BoundSurface& bound);
  /// Levels other than those of the last update are made anew.
  void update(const Frame& frame, const MethodOptions& options) override;
  MethodFindings findings() const override;
  double bytes() const override;

 private:
  /// Of one free vertex: b = Σ weight · corner, and p − b in the frame there: tangent, across,
  /// normal.
  struct Displacement {
    int corner[3];
    double weight[3];
    Eigen::Vector3d offset;
    bool along_normal;  // offset is (0, 0, h)
  };
  using Level = std::vector<Displacement>;
  struct Edge {
    int from = -1, to = -1;  // rows
  };
  /// A level's coarse surface as displacements see it.
  struct Carrier {
    const Rows& positions;
    const Rows& normals;
  };

  void make_levels(int count);
  void find_borders();
  /// Of every row, into normals_.
  void find_normals(const Rows& positions);
  Eigen::Vector3d displaced(const Carrier& carrier, const Displacement& displacement) const;
  Eigen::Matrix3d frame_at(const Carrier& carrier, const Displacement& displacement) const;
  void decompose(const Rows& fine, const Rows& coarse);
  /// Whether there is a point over the carrier, or over its border, near a row's own triangles.
  bool project(const Eigen::Vector3d& point, int row, const Carrier& carrier, Displacement& found);
  bool folds(const Carrier& carrier, const Level& level, int triangle) const;

  const BoundSurface& bound_;
  Triangles triangles_;          // with rows for corners: all near the free vertices
  Fans fans_;                    // of the rows
  std::vector<char> on_border_;  // of each triangle's corner: whether the edge opposite to it is
  std::vector<Edge> tangent_;    // of each row: along the border, or to a neighbour
  std::vector<Level> levels_;    // from S₀ over S₁ to S_(k−1) over B
  std::vector<int> seen_for_;    // of each triangle: the row whose projection looked at it last
  std::vector<int> unrepresented_;
  Rows crosses_, normals_;  // of triangles and rows
  Rows surface_, coarse_;   // on the way from B' to S'
};

}  // namespace dd
