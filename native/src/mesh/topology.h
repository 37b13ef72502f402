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

  /// An edge as one triangle has it: from its corner k to the next one, place = 3 × triangle + k.
  struct Side {
    int low, high;  ///< the edge's vertices
    int place;
    int triangle() const { return place / 3; }
  };
  struct Range {
    const Side *first, *last;
    const Side* begin() const { return first; }
    const Side* end() const { return last; }
    int size() const { return static_cast<int>(last - first); }
  };

  int count() const { return static_cast<int>(begin_.size()) - 1; }
  /// By ascending triangle.
  Range sides(int edge) const {
    return {sides_.data() + begin_[edge], sides_.data() + begin_[edge + 1]};
  }
  /// The edge at each place.
  std::vector<int> at_places() const;

 private:
  std::vector<Side> sides_;
  std::vector<int> begin_;
};

/// Where an open mesh ends: edges that only one triangle has.
struct Borders {
  Borders(const Triangles& triangles, int vertex_count);
  std::vector<char> places;    ///< 3m: whether the edge from corner k to the next is one
  std::vector<char> vertices;  ///< n: whether the vertex is at one
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
