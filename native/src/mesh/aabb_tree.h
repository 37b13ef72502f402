// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
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

Eigen::AlignedBox3d box_of(const Mesh& mesh, int triangle);

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
    return nearest(
        point, max_distance, [&](const Node& node) { return node.may_face(normal); },
        [&](int j) { return normals_.row(j).dot(normal) > 0 && accept(j); });
  }
  PointOnTriangle nearest_facing(const Eigen::Vector3d& point, const Eigen::Vector3d& normal,
                                 double max_distance) const {
    return nearest_facing(point, normal, max_distance, [](int) { return true; });
  }

  struct Exits {
    double beyond;  ///< of points at most this far none is an exit
    double max_distance = std::numeric_limits<double>::infinity();
    double outwards = 1;  ///< -1 where the triangles' normals point to the inside
  };
  /// The first point at which a ray leaves the surface: on a triangle whose outward normal has a
  /// positive dot product with the direction, and for which accept(j) is true. Triangle -1 if none.
  template <class Accept>
  PointOnTriangle first_exit(const Eigen::Vector3d& from, const Eigen::Vector3d& direction,
                             const Exits& exits, const Accept& accept) const;
  PointOnTriangle first_exit(const Eigen::Vector3d& from, const Eigen::Vector3d& direction,
                             const Exits& exits) const {
    return first_exit(from, direction, exits, [](int) { return true; });
  }

 private:
  static constexpr int kLeaf = 8;  // most triangles in a leaf
  // Safety: more than the levels of a tree of 2³¹ triangles, each half of the one above.
  static constexpr size_t kMaxDepth = 40;
  struct Node {
    Eigen::AlignedBox3d box, normals;  // bounds of the triangles and of their unit normals
    int begin, end, left = -1, right = -1;

    /// Whether a normal in these bounds may have a positive dot product with a direction.
    bool may_face(const Eigen::Vector3d& direction) const {
      return direction.cwiseProduct(normals.min())
                 .cwiseMax(direction.cwiseProduct(normals.max()))
                 .sum() > 0;
    }
  };
  int build(int begin, int end, const Positions& centres);

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
                                     const Exits& exits, const Accept& accept) const {
  // Safety: barycentric coordinates may be negative by this, or a ray could slip through between
  // triangles.
  constexpr double kBarycentricSlack = 1e-9;
  PointOnTriangle first;
  if (nodes_.empty() || !(direction.squaredNorm() > 0)) return first;
  const Eigen::Array3d unit_direction = direction.normalized();
  // Safety: without 0, whose inverse times 0 is no number.
  const Eigen::Array3d inverse =
      (unit_direction.abs() < 1e-300).select(1e-300, unit_direction).inverse();
  const Eigen::Vector3d facing = exits.outwards * unit_direction;
  double max_distance = exits.max_distance;
  // Where the ray enters a node's box, or infinity where it doesn't, or no triangle faces it there.
  const auto entry = [&](const Node& node) {
    const Eigen::Array3d low = (node.box.min().array() - from.array()) * inverse,
                         high = (node.box.max().array() - from.array()) * inverse;
    double begin = exits.beyond, end = max_distance;
    for (int k = 0; k < 3; ++k) {
      begin = std::max(begin, std::min(low[k], high[k]));
      end = std::min(end, std::max(low[k], high[k]));
    }
    return begin <= end && node.may_face(facing) ? begin : std::numeric_limits<double>::infinity();
  };
  std::array<std::pair<double, int>, kMaxDepth> open;
  size_t count = 0;
  const auto add = [&](double distance, int number) {
    if (distance < max_distance) open[count++] = {distance, number};
  };
  add(entry(nodes_[0]), 0);
  while (count > 0) {
    const auto [reached, number] = open[--count];
    if (!(reached < max_distance)) continue;
    const Node& node = nodes_[size_t(number)];
    if (node.left >= 0) {
      const double left = entry(nodes_[size_t(node.left)]),
                   right = entry(nodes_[size_t(node.right)]);
      // the nearer one last: it is popped first
      if (left < right) {
        add(right, node.right);
        add(left, node.left);
      } else {
        add(left, node.left);
        add(right, node.right);
      }
      continue;
    }
    for (int i = node.begin; i < node.end; ++i) {
      const int j = order_[size_t(i)];
      if (!(normals_.row(j).dot(facing) > 0) || !accept(j)) continue;
      const Eigen::Vector3d a = mesh_.positions.row(mesh_.triangles(j, 0)),
                            ab = mesh_.positions.row(mesh_.triangles(j, 1)).transpose() - a,
                            ac = mesh_.positions.row(mesh_.triangles(j, 2)).transpose() - a;
      const Eigen::Vector3d normal = ab.cross(ac), at = from - a,
                            turned = exits.outwards * at.cross(unit_direction.matrix());
      // v and w are barycentric coordinates times the volume.
      const double volume = normal.dot(facing), v = -ac.dot(turned), w = ab.dot(turned);
      const double slack = kBarycentricSlack * volume;
      if (!(volume > 0 && v >= -slack && w >= -slack && v + w <= volume + slack)) continue;
      const double distance = -exits.outwards * normal.dot(at) / volume;
      if (!(distance > exits.beyond && distance < max_distance)) continue;
      max_distance = distance;
      first.triangle = j;
      first.barycentric << 1 - (v + w) / volume, v / volume, w / volume;
      first.position = from + distance * unit_direction.matrix();
      first.squared_distance = distance * distance;
    }
  }
  return first;
}

}  // namespace dd
