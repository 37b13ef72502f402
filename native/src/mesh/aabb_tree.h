// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>
#include <numeric>
#include <utility>
#include <vector>

#include "mesh/mesh.h"

namespace dd {

/// A point on a triangle, by its barycentric weights.
struct PointOnTriangle {
  int triangle = -1;  // -1: none
  Eigen::Vector3d barycentric = Eigen::Vector3d::Zero();
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  double squared_distance = std::numeric_limits<double>::infinity();
};

/// The point for other positions of the vertices.
inline Eigen::RowVector3d position_of(const PointOnTriangle& point, const Positions& positions,
                                      const Triangles& triangles) {
  Eigen::RowVector3d sum = Eigen::RowVector3d::Zero();
  for (int k = 0; k < 3; ++k)
    sum += point.barycentric[k] * positions.row(triangles(point.triangle, k));
  return sum;
}

/// The closest point of triangle j (Ericson 2004).
PointOnTriangle nearest_on_triangle(const Mesh& mesh, int j, const Eigen::Vector3d& point);

/// A bounding volume hierarchy of axis-aligned boxes over a mesh's triangles. A node holds the
/// range [begin, end) of order_, its children the halves of it. The mesh must outlive it.
class AabbTree {
 public:
  explicit AabbTree(const Mesh& mesh);

  /// Calls visit(j) for each triangle whose box intersects the given triangle's, itself included.
  template <class Visit>
  void each_overlapping(int triangle, const Visit& visit) const {
    std::vector<int> open{0};
    while (!open.empty()) {
      const Node& node = nodes_[open.back()];
      open.pop_back();
      if (!node.box.intersects(boxes_[triangle])) continue;
      if (node.left >= 0) {
        open.push_back(node.left);
        open.push_back(node.right);
        continue;
      }
      for (int i = node.begin; i < node.end; ++i)
        if (boxes_[order_[i]].intersects(boxes_[triangle])) visit(order_[i]);
    }
  }

  /// The closest point on the triangles for which accept(j) is true, nearer than max_distance;
  /// triangle -1 if there is none.
  template <class Accept>
  PointOnTriangle nearest(const Eigen::Vector3d& point, double max_distance,
                          const Accept& accept) const {
    return nearest(point, max_distance, [](const Node&) { return true; }, accept);
  }

  /// The same on those accepted triangles whose normals have a positive dot product with the given
  /// one. Subtrees without such normals are pruned, so that a search that finds few or none ends
  /// early.
  template <class Accept>
  PointOnTriangle nearest_facing(const Eigen::Vector3d& point, const Eigen::Vector3d& normal,
                                 double max_distance, const Accept& accept) const {
    const auto may_face = [&](const Node& node) {
      return normal.cwiseProduct(node.normals.min())
                 .cwiseMax(normal.cwiseProduct(node.normals.max()))
                 .sum() > 0;
    };
    return nearest(point, max_distance, may_face,
                   [&](int j) { return normals_.row(j).dot(normal) > 0 && accept(j); });
  }
  PointOnTriangle nearest_facing(const Eigen::Vector3d& point, const Eigen::Vector3d& normal,
                                 double max_distance) const {
    return nearest_facing(point, normal, max_distance, [](int) { return true; });
  }

  /// The first point, farther than `beyond` from `from`, at which a ray leaves the surface: on a
  /// triangle whose normal has a positive dot product with the direction. Triangle -1 if none.
  PointOnTriangle first_exit(const Eigen::Vector3d& from, const Eigen::Vector3d& direction,
                             double beyond) const {
    return first_exit(from, direction, beyond, 1, [](int) { return true; });
  }
  /// The same among the triangles for which accept(j) is true. outwards: 1, or -1 where their
  /// normals point to the inside.
  template <class Accept>
  PointOnTriangle first_exit(const Eigen::Vector3d& from, const Eigen::Vector3d& direction,
                             double beyond, double outwards, const Accept& accept) const;

 private:
  static constexpr int kLeaf = 8;  // most triangles in a leaf
  struct Node {
    Eigen::AlignedBox3d box, normals;  // bounds of the triangles and of their unit normals
    int begin, end, left = -1, right = -1;
  };
  int build(int begin, int end);

  /// nearest() without the subtrees for which enter(node) is false.
  template <class Enter, class Accept>
  PointOnTriangle nearest(const Eigen::Vector3d& point, double max_distance, const Enter& enter,
                          const Accept& accept) const {
    PointOnTriangle best;
    best.squared_distance = max_distance * max_distance;
    if (nodes_.empty()) return best;
    std::vector<std::pair<double, int>> open{{nodes_[0].box.squaredExteriorDistance(point), 0}};
    while (!open.empty()) {
      const auto [distance, number] = open.back();
      open.pop_back();
      if (distance >= best.squared_distance) continue;
      const Node& node = nodes_[number];
      if (!enter(node)) continue;
      if (node.left >= 0) {
        std::pair<double, int> left{nodes_[node.left].box.squaredExteriorDistance(point),
                                    node.left};
        std::pair<double, int> right{nodes_[node.right].box.squaredExteriorDistance(point),
                                     node.right};
        if (left.first < right.first) std::swap(left, right);
        open.push_back(left);  // the nearer one last: it is popped first
        open.push_back(right);
        continue;
      }
      for (int i = node.begin; i < node.end; ++i) {
        const int j = order_[i];
        if (boxes_[j].squaredExteriorDistance(point) >= best.squared_distance || !accept(j))
          continue;
        const PointOnTriangle found = nearest_on_triangle(mesh_, j, point);
        if (found.squared_distance < best.squared_distance) best = found;
      }
    }
    return best;
  }

  const Mesh& mesh_;
  Positions normals_;
  std::vector<Eigen::AlignedBox3d> boxes_;
  std::vector<int> order_;
  std::vector<Node> nodes_;
};

template <class Accept>
PointOnTriangle AabbTree::first_exit(const Eigen::Vector3d& from, const Eigen::Vector3d& direction,
                                     double beyond, double outwards, const Accept& accept) const {
  // Safety: barycentric coordinates may be negative by this, or a ray could slip through between
  // triangles.
  constexpr double kBarycentricSlack = 1e-9;
  PointOnTriangle first;
  if (nodes_.empty() || !(direction.squaredNorm() > 0)) return first;
  const Eigen::Vector3d unit_direction = direction.normalized();
  double max_distance = std::numeric_limits<double>::infinity();
  const auto enters = [&](const Eigen::AlignedBox3d& box) {
    double begin = beyond, end = max_distance;
    for (int k = 0; k < 3; ++k) {
      const double low = box.min()[k] - from[k], high = box.max()[k] - from[k];
      if (unit_direction[k] == 0) {
        if (low > 0 || high < 0) return false;
        continue;
      }
      begin = std::max(begin, (unit_direction[k] > 0 ? low : high) / unit_direction[k]);
      end = std::min(end, (unit_direction[k] > 0 ? high : low) / unit_direction[k]);
    }
    return begin <= end;
  };
  std::vector<int> open{0};
  while (!open.empty()) {
    const Node& node = nodes_[open.back()];
    open.pop_back();
    if (!enters(node.box)) continue;
    if (node.left >= 0) {
      const Eigen::Vector3d apart =
          nodes_[node.right].box.center() - nodes_[node.left].box.center();
      const bool left_first = apart.dot(unit_direction) > 0;
      open.push_back(left_first ? node.right : node.left);
      open.push_back(left_first ? node.left : node.right);
      continue;
    }
    for (int i = node.begin; i < node.end; ++i) {
      const int j = order_[i];
      if (!(outwards * normals_.row(j).dot(unit_direction) > 0) || !accept(j)) continue;
      const Eigen::Vector3d a = mesh_.positions.row(mesh_.triangles(j, 0)),
                            ab = mesh_.positions.row(mesh_.triangles(j, 1)).transpose() - a,
                            ac = mesh_.positions.row(mesh_.triangles(j, 2)).transpose() - a;
      const Eigen::Vector3d normal = ab.cross(ac), at = from - a, turned = at.cross(unit_direction);
      const double volume = normal.dot(unit_direction), distance = -normal.dot(at) / volume;
      const double v = -ac.dot(turned) / volume, w = ab.dot(turned) / volume;
      if (!(distance > beyond && distance < max_distance && v >= -kBarycentricSlack &&
            w >= -kBarycentricSlack && v + w <= 1 + kBarycentricSlack))
        continue;
      max_distance = distance;
      first.triangle = j;
      first.barycentric << 1 - v - w, v, w;
      first.position = from + distance * unit_direction;
      first.squared_distance = distance * distance;
    }
  }
  return first;
}

}  // namespace dd
