// SPDX-License-Identifier: GPL-3.0-or-later
#include "intersections.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>

namespace dd {

namespace {

using Box = Eigen::AlignedBox3d;

/// A tree of boxes over the triangles: each node holds the range [begin, end) of order_, and its
/// children the halves of it.
class BoxTree {
 public:
  explicit BoxTree(const Mesh& mesh) : boxes_(static_cast<size_t>(mesh.triangle_count())) {
    for (int j = 0; j < mesh.triangle_count(); ++j)
      for (int k = 0; k < 3; ++k)
        boxes_[j].extend(mesh.positions.row(mesh.triangles(j, k)).transpose());
    order_.resize(boxes_.size());
    std::iota(order_.begin(), order_.end(), 0);
    build(0, static_cast<int>(order_.size()));
  }

  /// Calls visit(j) for each triangle whose box meets that of the given one.
  template <class Visit>
  void meet(int triangle, const Visit& visit) const {
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

 private:
  static constexpr int kLeaf = 8;
  struct Node {
    Box box;
    int begin, end, left = -1, right = -1;
  };

  int build(int begin, int end) {
    const int number = static_cast<int>(nodes_.size());
    nodes_.push_back({Box(), begin, end});
    for (int i = begin; i < end; ++i) nodes_[number].box.extend(boxes_[order_[i]]);
    if (end - begin <= kLeaf) return number;
    Index axis = 0;
    nodes_[number].box.sizes().maxCoeff(&axis);
    const int middle = begin + (end - begin) / 2;
    std::nth_element(
        order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
        [&](int a, int b) { return boxes_[a].center()[axis] < boxes_[b].center()[axis]; });
    const int left = build(begin, middle), right = build(middle, end);
    nodes_[number].left = left;
    nodes_[number].right = right;
    return number;
  }

  std::vector<Box> boxes_;
  std::vector<int> order_;
  std::vector<Node> nodes_;
};

double volume(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
              const Eigen::Vector3d& d) {
  return (b - a).cross(c - a).dot(d - a);
}

/// Whether the segment from vertex p to vertex q crosses the inside of triangle j.
bool crosses(const Mesh& mesh, int p, int q, int j) {
  const Eigen::Vector3d x = mesh.positions.row(p), y = mesh.positions.row(q);
  const auto corner = mesh.triangles.row(j);
  const Eigen::Vector3d a = mesh.positions.row(corner[0]), b = mesh.positions.row(corner[1]),
                        c = mesh.positions.row(corner[2]);
  // Heights over the triangle's plane that are rounding have no sign.
  const double size = std::max({(b - a).norm(), (c - a).norm(), (y - x).norm(), (x - a).norm()});
  const double below = volume(a, b, c, x), above = volume(a, b, c, y);
  if (std::min(std::abs(below), std::abs(above)) < 1e-12 * size * size * size) return false;
  if ((below < 0) == (above < 0)) return false;
  const double u = volume(x, y, a, b), v = volume(x, y, b, c), w = volume(x, y, c, a);
  return (u > 0 && v > 0 && w > 0) || (u < 0 && v < 0 && w < 0);
}

}  // namespace

bool triangles_intersect(const Mesh& mesh, int first, int second) {
  const auto a = mesh.triangles.row(first), b = mesh.triangles.row(second);
  int shared = 0, of_first = -1, of_second = -1;
  for (int k = 0; k < 3; ++k)
    for (int l = 0; l < 3; ++l)
      if (a[k] == b[l]) {
        ++shared;
        of_first = k;
        of_second = l;
      }
  if (shared > 1) return false;
  for (int k = 0; k < 3; ++k) {
    // With a shared corner only the edge opposite to it can cross.
    if ((shared == 0 || k == of_first) && crosses(mesh, a[(k + 1) % 3], a[(k + 2) % 3], second))
      return true;
    if ((shared == 0 || k == of_second) && crosses(mesh, b[(k + 1) % 3], b[(k + 2) % 3], first))
      return true;
  }
  return false;
}

std::vector<std::pair<int, int>> intersecting_pairs(const Mesh& mesh) {
  std::vector<std::pair<int, int>> pairs;
  if (mesh.triangle_count() == 0) return pairs;
  const BoxTree tree(mesh);
  for (int j = 0; j < mesh.triangle_count(); ++j)
    tree.meet(j, [&](int other) {
      if (other > j && triangles_intersect(mesh, j, other)) pairs.emplace_back(j, other);
    });
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

}  // namespace dd
