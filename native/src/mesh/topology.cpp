// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/topology.h"

#include <algorithm>
#include <numeric>

namespace dd {

VertexTriangles::VertexTriangles(const Triangles& t, int vertex_count)
    : begin_(static_cast<size_t>(vertex_count) + 1, 0), triangles_(static_cast<size_t>(t.size())) {
  for (Index k = 0; k < t.size(); ++k) ++begin_[t.data()[k] + 1];
  std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
  std::vector<int> next(begin_.begin(), begin_.end() - 1);
  for (Index k = 0; k < t.size(); ++k) triangles_[next[t.data()[k]]++] = static_cast<int>(k / 3);
}

Edges::Edges(const Triangles& t) {
  // Bucket sort by the lower vertex; then only the few half-edges of each bucket are sorted.
  std::vector<int> end(t.size() == 0 ? 1 : static_cast<size_t>(t.maxCoeff()) + 2, 0);
  const auto half_edge = [&](int number) {
    const int a = t.data()[number], b = t.data()[number % 3 == 2 ? number - 2 : number + 1];
    return HalfEdge{std::min(a, b), std::max(a, b), number};
  };
  const int count = static_cast<int>(t.size());
  for (int number = 0; number < count; ++number) ++end[half_edge(number).low + 1];
  std::partial_sum(end.begin(), end.end(), end.begin());
  half_edges_.resize(static_cast<size_t>(count));
  for (int number = 0; number < count; ++number) {
    const HalfEdge edge = half_edge(number);
    half_edges_[end[edge.low]++] = edge;
  }
  for (size_t low = 0; low + 1 < end.size(); ++low)
    std::sort(half_edges_.begin() + (low == 0 ? 0 : end[low - 1]), half_edges_.begin() + end[low],
              [](const HalfEdge& a, const HalfEdge& b) {
                return a.high != b.high ? a.high < b.high : a.number < b.number;
              });
  for (size_t i = 0; i < half_edges_.size(); ++i)
    if (i == 0 || half_edges_[i].low != half_edges_[i - 1].low ||
        half_edges_[i].high != half_edges_[i - 1].high)
      begin_.push_back(static_cast<int>(i));
  begin_.push_back(static_cast<int>(half_edges_.size()));
}

std::vector<int> Edges::of_half_edges() const {
  std::vector<int> edges(half_edges_.size());
  for (int edge = 0; edge < count(); ++edge)
    for (const HalfEdge& side : of(edge)) edges[side.number] = edge;
  return edges;
}

Borders::Borders(const Triangles& triangles, int vertex_count)
    : half_edges(static_cast<size_t>(triangles.size()), 0),
      vertices(static_cast<size_t>(vertex_count), 0) {
  const Edges edges(triangles);
  for (int edge = 0; edge < edges.count(); ++edge) {
    const Edges::Range sides = edges.of(edge);
    if (sides.size() > 1) continue;
    half_edges[sides.begin()->number] = 1;
    vertices[sides.begin()->low] = vertices[sides.begin()->high] = 1;
  }
}

namespace {

int find_root(std::vector<int>& parent, int v) {
  while (parent[v] != v) v = parent[v] = parent[parent[v]];
  return v;
}

/// Spreads values by breadth-first search from the triangles that have one (≥ 0) to those without.
/// Joints are the edges or the vertices that connect triangles: joint_at(j, k) is the k-th of
/// triangle j, each_at(joint, visit) visits its triangles. Each joint is passed once, in an order
/// that depends on the mesh alone, and so does the result.
template <class JointAt, class EachAt>
void spread(std::vector<int>& of_triangle, size_t joint_count, const JointAt& joint_at,
            const EachAt& each_at) {
  std::vector<int> queue;
  for (size_t j = 0; j < of_triangle.size(); ++j)
    if (of_triangle[j] >= 0) queue.push_back(static_cast<int>(j));
  std::vector<char> passed(joint_count, 0);
  for (size_t head = 0; head < queue.size(); ++head) {
    const int j = queue[head];
    for (int k = 0; k < 3; ++k) {
      const int joint = joint_at(j, k);
      if (passed[joint]) continue;
      passed[joint] = 1;
      each_at(joint, [&](int other) {
        if (of_triangle[other] >= 0) return;
        of_triangle[other] = of_triangle[j];
        queue.push_back(other);
      });
    }
  }
}

}  // namespace

Components::Components(const Triangles& triangles, int vertex_count) {
  std::vector<int> parent(static_cast<size_t>(vertex_count));
  std::iota(parent.begin(), parent.end(), 0);
  for (Index j = 0; j < triangles.rows(); ++j) {
    const int root = find_root(parent, triangles(j, 0));
    for (int k = 1; k < 3; ++k) parent[find_root(parent, triangles(j, k))] = root;
  }
  of_vertex.assign(parent.size(), -1);
  for (int v = 0; v < vertex_count; ++v) {
    int& number = of_vertex[find_root(parent, v)];
    if (number < 0) number = count++;
    of_vertex[v] = number;
  }
}

void fill_from_neighbours(std::vector<int>& of_triangle, const Triangles& t, int vertex_count) {
  const Edges edges(t);
  const std::vector<int> edge_of = edges.of_half_edges();
  spread(
      of_triangle, static_cast<size_t>(edges.count()),
      [&](int j, int k) { return edge_of[3 * static_cast<size_t>(j) + static_cast<size_t>(k)]; },
      [&](int edge, const auto& visit) {
        for (const Edges::HalfEdge& side : edges.of(edge)) visit(side.triangle());
      });
  const VertexTriangles fans(t, vertex_count);
  spread(
      of_triangle, static_cast<size_t>(vertex_count), [&](int j, int k) { return t(j, k); },
      [&](int vertex, const auto& visit) {
        for (int other : fans.of(vertex)) visit(other);
      });
}

}  // namespace dd
