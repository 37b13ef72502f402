// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "support/types.h"

namespace dd {

/// The triangles of each vertex's one-ring.
class VertexTriangles {
 public:
  VertexTriangles(const Triangles& triangles, int vertex_count);

  struct Range {
    const int *first, *last;
    const int* begin() const { return first; }
    const int* end() const { return last; }
  };
  /// Indices of the triangles at a vertex, ascending.
  Range of(int vertex) const {
    return {triangles_.data() + begin_[vertex], triangles_.data() + begin_[vertex + 1]};
  }
  double bytes() const {
    return static_cast<double>((begin_.size() + triangles_.size()) * sizeof(int));
  }

 private:
  std::vector<int> begin_, triangles_;
};

/// The edges of a triangle soup, each with its half-edges, any number of them.
class Edges {
 public:
  explicit Edges(const Triangles& triangles);

  /// A triangle's side, from its corner k to the next one.
  struct HalfEdge {
    int low, high;  ///< the edge's vertices, low < high
    int number;     ///< 3 × triangle + k
    int triangle() const { return number / 3; }
  };
  struct Range {
    const HalfEdge *first, *last;
    const HalfEdge* begin() const { return first; }
    const HalfEdge* end() const { return last; }
    int size() const { return static_cast<int>(last - first); }
  };

  int count() const { return static_cast<int>(begin_.size()) - 1; }
  /// The half-edges of an edge, by ascending triangle.
  Range of(int edge) const {
    return {half_edges_.data() + begin_[edge], half_edges_.data() + begin_[edge + 1]};
  }
  /// The edge of each half-edge, 3m, by its number.
  std::vector<int> of_half_edges() const;

 private:
  std::vector<HalfEdge> half_edges_;
  std::vector<int> begin_;
};

/// The border of an open mesh: the edges that have only one triangle.
struct Borders {
  Borders(const Triangles& triangles, int vertex_count);
  std::vector<char> half_edges;  ///< 3m, by number: non-zero on the border
  std::vector<char> vertices;    ///< n: non-zero on the border
};

/// Connected components: for each vertex the number of its own, connected through triangles. A
/// vertex without a triangle is a component by itself.
struct Components {
  Components() = default;
  Components(const Triangles& triangles, int vertex_count);
  std::vector<int> of_vertex;
  int count = 0;
};

/// Replaces each -1 by the value of the nearest triangle that has one, by breadth-first search
/// across shared edges and then across shared vertices. Components without any value keep -1.
void fill_from_neighbours(std::vector<int>& of_triangle, const Triangles& triangles,
                          int vertex_count);

}  // namespace dd
