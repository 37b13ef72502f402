// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mesh/aabb_tree.h"
#include "mesh/mesh.h"
#include "reconstruction/gradients.h"
#include "support/thread_pool.h"

namespace dd {

/// A base of another topology (proxy): a cage, or a coarser or finer copy. A vertex x of S is bound
/// to its closest point y on the proxy, in a triangle with corners c_k and barycentric weights λ_k:
///
///   x' = y' + F(y) (x − y),   F(y) = Σ λ_k F_k,
///   y' = Σ λ_k (c'_k + ½ F_k (y − c_k)),
///
/// F_k is the area-weighted mean of the deformation gradients (15) of the one-ring of c_k; at
/// border vertices it is extrapolated from inner neighbours. F is continuous across the proxy's
/// edges. The slope of y' jumps there only by the order of the squared dihedral angle, because the
/// factor ½ makes y' turn at a corner as F_k does (James 2020, Phong Deformation). So the proxy's
/// faces don't show. At rest x' = x: the base is S itself, and its gradients hold only the proxy's
/// motion.
class BaseProxy {
 public:
  /// surface: S. proxy: at rest, validated. Both in the box of about unit size. Fills far and
  /// ambiguous.
  BaseProxy(const Mesh& surface, Mesh proxy);
  /// For points, n×3, with known closest points on the proxy. far and ambiguous stay empty.
  BaseProxy(const Positions& points, const std::vector<PointOnTriangle>& nearest, Mesh proxy);

  int vertex_count() const { return rest_.vertex_count(); }
  /// deformed: the proxy's deformed vertices. Returns x', n×3.
  Positions carry(const Positions& deformed, ThreadPool& pool) const;

  /// Vertices of S farther from the proxy than a tenth of the proxy's box diagonal.
  std::vector<int> far;
  /// Vertices of S whose closest point and that of an edge neighbour lie far apart: they may be
  /// bound to different parts of the proxy.
  std::vector<int> ambiguous;

  double bytes() const;

 private:
  explicit BaseProxy(Mesh proxy);
  void bind(const Eigen::Vector3d& x, const PointOnTriangle& y);
  void find_ambiguous(const Mesh& surface);
  void find_borders();
  std::vector<Eigen::Matrix3d> corner_gradients(const Positions& deformed) const;

  Mesh rest_;
  Eigen::VectorXd areas_;
  StandIns stand_ins_;
  std::vector<Eigen::Matrix3d> rest_inverses_;  // of each triangle at rest, (e_1, e_2, n)⁻¹
  struct Border {
    int vertex;
    std::vector<int> inner;  // edge neighbours that are not on a border
  };
  std::vector<Border> borders_;
  struct Binding {
    int triangle;
    Eigen::Vector3d weights, position, arm;  // λ, y, x − y
  };
  std::vector<Binding> bindings_;
};

}  // namespace dd
