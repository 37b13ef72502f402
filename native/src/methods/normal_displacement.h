// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <limits>
#include <vector>

#include "mesh/topology.h"
#include "methods/method.h"

namespace dd {

/// VarMin with normal displacements (§1, Fig. 1c, 3 to 5, after Kobbelt et al.): S = B ⊕ D,
///
///   p = b + h · n(b)
///
/// b is the point on B's triangles, with linearly interpolated vertex normals n, found by
/// projecting p. S' has the same barycentric b and h on B'. With several levels S₀ = S, S₁, ...,
/// S_k = B each surface is smoother than the one before, which is stored as displacements over it.
///
/// Smoothing contracts open borders, so vertices of S may lie beyond the border of B. They are
/// bound to the closest point b of the border by p = b + F(b) d, F the frame of normal and border
/// tangent. A vertex without a projection nearby is bound in the same way to its own vertex of the
/// smoother surface. There S is not a height field, and the representation fails. It also fails
/// where S folds over the smoother surface and several vertices have the same b. These vertices are
/// reported.
class NormalDisplacement : public Method {
 public:
  explicit NormalDisplacement(const BoundSurface& bound);
  /// Recomputes the levels if their number has changed since the last update.
  void update(const Frame& frame, const MethodOptions& options) override;
  MethodFindings findings() const override;
  double bytes() const override;

 private:
  /// Of one free vertex: b = Σ weight · corner, and p − b in the frame at b with the axes tangent,
  /// bitangent, normal.
  struct Displacement {
    int corner[3];
    double weight[3];
    Eigen::Vector3d offset;
    bool along_normal;  // whether offset is (0, 0, h)
  };
  using Level = std::vector<Displacement>;
  struct RowEdge {
    int from = -1, to = -1;  // rows
  };
  /// The smoother surface of a level, with its vertex normals.
  struct Carrier {
    const Rows& positions;
    const Rows& normals;
  };

  void make_levels(int count);
  void find_borders();
  /// Computes cross_products_, and vertex_normals_ of all rows: area-weighted vertex normals.
  void compute_normals(const Rows& positions);
  Eigen::Vector3d displaced(const Carrier& carrier, const Displacement& displacement) const;
  Eigen::Matrix3d frame_at(const Carrier& carrier, const Displacement& displacement) const;
  /// Stores fine as displacements over coarse, the next smoother surface, in a new level.
  void decompose(const Rows& fine, const Rows& coarse);
  /// Projects a vertex onto the carrier, or onto its border if it lies beyond. Searches from the
  /// vertex' own triangles outwards; false if it finds neither.
  bool project(const Eigen::Vector3d& point, int row, const Carrier& carrier, Displacement& found);
  /// Projects a point onto a triangle along the carrier's normals. Returns whether b is in it.
  bool project_onto_triangle(const Eigen::Vector3d& point, int triangle, const Carrier& carrier,
                             Displacement& found) const;
  /// The border edge closest to a point, of those visited.
  struct BorderProjection {
    double distance = std::numeric_limits<double>::infinity();
    bool is_beyond = false;  // whether the point lies on the edge's outer side
  };
  /// Projects a point onto the border edge opposite to corner k of a triangle if that is closer
  /// than the closest so far.
  void project_onto_border(const Eigen::Vector3d& point, int triangle, int k,
                           const Carrier& carrier, BorderProjection& closest,
                           Displacement& found) const;
  /// Whether the projections b of the triangle's corners have the reversed orientation.
  bool folds(const Carrier& carrier, const Level& level, int triangle) const;

  const BoundSurface& bound_;
  Triangles triangles_;                 // corners are rows: triangles_near_free()
  VertexTriangles fans_;                // triangles around each row
  std::vector<char> opposite_border_;   // of each triangle corner: whether its edge is a border
  std::vector<RowEdge> tangent_edges_;  // of each row: along the border, or to a neighbour
  std::vector<Level> levels_;           // S₀ over S₁, ..., S_(k−1) over B
  std::vector<int> last_visited_for_;   // of each triangle: the row that visited it last
  std::vector<int> unrepresented_;
  Rows cross_products_, vertex_normals_;  // cross products of triangles, unit normals of rows
  Rows fine_, coarse_;                    // intermediate surfaces from B' to S'
};

}  // namespace dd
