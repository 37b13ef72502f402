// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/aabb_tree.h"

#include "mesh/triangles.h"

namespace dd {

PointOnTriangle nearest_on_triangle(const Mesh& mesh, int j, const Eigen::Vector3d& point) {
  const auto corner = mesh.triangles.row(j);
  const Eigen::Vector3d a = mesh.positions.row(corner[0]), b = mesh.positions.row(corner[1]),
                        c = mesh.positions.row(corner[2]);
  const Eigen::Vector3d ab = b - a, ac = c - a;
  const auto at = [&](double v, double w) {
    PointOnTriangle found;
    found.triangle = j;
    found.barycentric << 1 - v - w, v, w;
    found.position = a + v * ab + w * ac;
    found.squared_distance = (point - found.position).squaredNorm();
    return found;
  };
  // A parameter along an edge or a barycentric weight; 0 if there is no extent.
  const auto share = [](double part, double whole) { return whole > 0 ? part / whole : 0.0; };
  const double d1 = ab.dot(point - a), d2 = ac.dot(point - a);
  if (d1 <= 0 && d2 <= 0) return at(0, 0);
  const double d3 = ab.dot(point - b), d4 = ac.dot(point - b);
  if (d3 >= 0 && d4 <= d3) return at(1, 0);
  const double d5 = ab.dot(point - c), d6 = ac.dot(point - c);
  if (d6 >= 0 && d5 <= d6) return at(0, 1);
  const double of_c = d1 * d4 - d3 * d2, of_b = d5 * d2 - d1 * d6, of_a = d3 * d6 - d5 * d4;
  if (of_c <= 0 && d1 >= 0 && d3 <= 0) return at(share(d1, d1 - d3), 0);
  if (of_b <= 0 && d2 >= 0 && d6 <= 0) return at(0, share(d2, d2 - d6));
  if (of_a <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    const double w = share(d4 - d3, (d4 - d3) + (d5 - d6));
    return at(1 - w, w);
  }
  const double sum = of_a + of_b + of_c;
  return at(share(of_b, sum), share(of_c, sum));
}

Eigen::AlignedBox3d box_of(const Mesh& mesh, int triangle) {
  Eigen::AlignedBox3d box;
  for (int k = 0; k < 3; ++k)
    box.extend(mesh.positions.row(mesh.triangles(triangle, k)).transpose());
  return box;
}

AabbTree::AabbTree(const Mesh& mesh)
    : mesh_(mesh),
      normals_(triangle_normals(mesh.positions, mesh.triangles)),
      boxes_(static_cast<size_t>(mesh.triangle_count())) {
  Positions centres(mesh.triangle_count(), 3);
  for (int j = 0; j < mesh.triangle_count(); ++j) {
    boxes_[j] = box_of(mesh, j);
    centres.row(j) = boxes_[j].center().transpose();
  }
  order_.resize(boxes_.size());
  std::iota(order_.begin(), order_.end(), 0);
  if (!order_.empty()) build(0, static_cast<int>(order_.size()), centres);
}

int AabbTree::build(int begin, int end, const Positions& centres) {
  const int number = static_cast<int>(nodes_.size());
  nodes_.push_back({Eigen::AlignedBox3d(), Eigen::AlignedBox3d(), begin, end});
  Node node = nodes_.back();
  if (end - begin <= kLeaf) {
    for (int i = begin; i < end; ++i) {
      node.box.extend(boxes_[order_[i]]);
      node.normals.extend(normals_.row(order_[i]).transpose());
    }
  } else {
    Eigen::AlignedBox3d of_centres;
    for (int i = begin; i < end; ++i) of_centres.extend(centres.row(order_[i]).transpose());
    Index axis = 0;
    of_centres.sizes().maxCoeff(&axis);
    const int middle = begin + (end - begin) / 2;
    std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                     [&](int a, int b) { return centres(a, axis) < centres(b, axis); });
    node.left = build(begin, middle, centres);
    node.right = build(middle, end, centres);
    for (int child : {node.left, node.right}) {
      node.box.extend(nodes_[child].box);
      node.normals.extend(nodes_[child].normals);
    }
  }
  nodes_[number] = node;
  return number;
}

}  // namespace dd
