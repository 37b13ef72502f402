// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "support/types.h"

namespace dd {

/// The triangles around each vertex.
class Fans {
 public:
  Fans(const Triangles& triangles, int vertex_count);

  struct Range {
    const int *first, *last;
    const int* begin() const { return first; }
    const int* end() const { return last; }
  };
  /// Ascending.
  Range of(int vertex) const {
    return {triangles_.data() + begin_[vertex], triangles_.data() + begin_[vertex + 1]};
  }
  double bytes() const {
    return static_cast<double>((begin_.size() + triangles_.size()) * sizeof(int));
  }

 private:
  std::vector<int> begin_, triangles_;
};

/// The edges of a triangle soup, each with all the triangles that have it.
class Edges {
 public:
  explicit Edges(const Triangles& triangles);

  /// An edge as one triangle has it, from its corner k to the next one.
  struct HalfEdge {
    int low, high;  ///< the edge's vertices
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
  /// By ascending triangle.
  Range of(int edge) const {
    return {half_edges_.data() + begin_[edge], half_edges_.data() + begin_[edge + 1]};
  }
  /// The edge of each half-edge, by number.
  std::vector<int> of_half_edges() const;

 private:
  std::vector<HalfEdge> half_edges_;
  std::vector<int> begin_;
};

/// Where an open mesh ends: edges that only one triangle has.
struct Borders {
  Borders(const Triangles& triangles, int vertex_count);
  std::vector<char> half_edges;  ///< 3m, by number: whether its edge is one
  std::vector<char> vertices;    ///< n: whether the vertex is at one
};

/// Loose parts: for each vertex the number of its part, connected through triangles. A vertex
/// without a triangle is a part by itself.
struct Components {
  Components(const Triangles& triangles, int vertex_count);
  std::vector<int> of_vertex;
  int count = 0;
};

/// Gives each triangle whose value is -1 that of the nearest triangle with one across shared edges,
/// or else vertices, unless its whole component has none.
void fill_from_neighbours(std::vector<int>& of_triangle, const Triangles& triangles,
                          int vertex_count);

}  // namespace dd
