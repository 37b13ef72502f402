// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mesh/aabb_tree.h"
#include "mesh/mesh.h"
#include "reconstruction/gradients.h"
#include "support/thread_pool.h"

namespace dd {

/// A base of another topology: a cage, or a coarser or finer copy. A vertex x of S is bound to the
/// nearest point y of it, with corners k and barycentric weights λ_k there, and goes to
///
///   x' = y' + F(y) (x − y),   F(y) = Σ λ_k F_k,
///   y' = Σ λ_k (c'_k + ½ F_k (y − c_k)),
///
/// F_k the mean of the deformation gradients (15) of the triangles around a corner c_k, at a border
/// continued from its neighbours. F is continuous across its edges, and so is the slope of y' but
/// for a part that falls with the square of their angles: the half makes y' turn at a corner as F
/// does there (James 2020, Phong Deformation). So none of its faces shows. At rest x' is x, so that
/// S is a base of its own, and what is carried is how it turns.
class BaseProxy {
 public:
  /// surface: S, n×3. proxy: at rest, validated. In a box of about unit size.
  BaseProxy(const Mesh& surface, Mesh proxy);
  /// Of points, n×3, whose nearest ones are known.
  BaseProxy(const Positions& points, const std::vector<PointOnTriangle>& nearest, Mesh proxy);

  int vertex_count() const { return rest_.vertex_count(); }
  /// deformed: as many vertices as the proxy's. Returns x', n×3.
  Positions carry(const Positions& deformed, ThreadPool& pool) const;

  /// Vertices that are farther from the proxy than a tenth of its box.
  std::vector<int> far;
  /// Vertices between parts of it: their nearest point and a neighbour's lie far apart.
  std::vector<int> torn;

  double bytes() const;

 private:
  explicit BaseProxy(Mesh proxy);
  void bind(const Eigen::Vector3d& x, const PointOnTriangle& y);
  void find_torn(const Mesh& surface);
  void find_borders();
  std::vector<Eigen::Matrix3d> corner_gradients(const Positions& deformed) const;

  Mesh rest_;
  Eigen::VectorXd areas_;
  StandIns stand_ins_;
  std::vector<Eigen::Matrix3d> inverse_;  // of each triangle, (e_1, e_2, n)⁻¹
  struct Border {
    int vertex;
    std::vector<int> inner;  // neighbours that are on no border
  };
  std::vector<Border> borders_;
  struct Binding {
    int triangle;
    Eigen::Vector3d weights, place, arm;  // λ, y, x − y
  };
  std::vector<Binding> bindings_;
};

}  // namespace dd
