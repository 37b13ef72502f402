// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/contraction.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <tuple>
#include <utility>

#include "mesh/topology.h"

namespace dd {

namespace {

// Most rounds of repair, as undoing merges may break the fans of their neighbours. If some are
// still broken after these, nothing is merged at all.
constexpr int kRepairRounds = 8;

class Contracting {
 public:
  Contracting(const Mesh& mesh, const std::vector<double>& radii)
      : mesh_(mesh),
        radii_(radii),
        fans_(mesh.triangles, mesh.vertex_count()),
        label_(radii.size(), -1),
        distance_(radii.size(), std::numeric_limits<double>::infinity()) {}

  Contraction run() {
    assign_centers();
    const Borders borders(mesh_.triangles, mesh_.vertex_count());
    for (int round = 0; round < kRepairRounds; ++round) {
      const std::vector<int> broken_fans = find_broken_fans(borders.vertices);
      if (broken_fans.empty()) return result();
      undo_merges(broken_fans);
    }
    std::iota(label_.begin(), label_.end(), 0);
    return result();
  }

 private:
  /// Labels each vertex with its nearest center, by Dijkstra's method within the center's radius.
  /// Centers are chosen greedily, by their coordinates, among the vertices not yet labelled.
  void assign_centers() {
    const Positions& p = mesh_.positions;
    std::vector<int> order;
    for (int v = 0; v < mesh_.vertex_count(); ++v)
      if (fans_.of(v).begin() != fans_.of(v).end()) order.push_back(v);
    std::sort(order.begin(), order.end(), [&](int a, int b) {
      return std::make_tuple(p(a, 0), p(a, 1), p(a, 2), a) <
             std::make_tuple(p(b, 0), p(b, 1), p(b, 2), b);
    });
    using Entry = std::pair<double, int>;
    std::vector<Entry> heap;
    const auto later = [](const Entry& a, const Entry& b) { return a > b; };
    for (int center : order) {
      if (label_[center] >= 0) continue;
      label_[center] = center;
      distance_[center] = 0;
      if (radii_[center] == 0) continue;
      heap.assign(1, {0.0, center});
      while (!heap.empty()) {
        std::pop_heap(heap.begin(), heap.end(), later);
        const auto [d, v] = heap.back();
        heap.pop_back();
        if (d > distance_[v]) continue;
        for (int j : fans_.of(v))
          for (int k = 0; k < 3; ++k) {
            const int w = mesh_.triangles(j, k);
            if (w == v || radii_[w] == 0) continue;
            const double reached = d + (p.row(w) - p.row(v)).norm();
            if (reached > radii_[center] || reached >= distance_[w]) continue;
            distance_[w] = reached;
            label_[w] = center;
            heap.emplace_back(reached, w);
            std::push_heap(heap.begin(), heap.end(), later);
          }
      }
    }
  }

  /// The triangles whose corners have three different numbers, as triples of these numbers.
  Triangles remaining_triangles(const std::vector<int>& numbers) const {
    Triangles numbered(mesh_.triangles.rows(), 3);
    Index count = 0;
    for (int j = 0; j < mesh_.triangle_count(); ++j) {
      const int a = numbers[mesh_.triangles(j, 0)], b = numbers[mesh_.triangles(j, 1)],
                c = numbers[mesh_.triangles(j, 2)];
      if (a != b && b != c && c != a) numbered.row(count++) << a, b, c;
    }
    return numbered.topRows(count);
  }

  bool unmerged(int center) const { return size_[center] == 1; }

  /// Centers whose remaining triangles don't form one fan, among those with merged vertices and
  /// their neighbours.
  std::vector<int> find_broken_fans(const std::vector<char>& borders) {
    const int n = mesh_.vertex_count();
    size_.assign(static_cast<size_t>(n), 0);
    std::vector<char> at_border(static_cast<size_t>(n), 0), near_merges(static_cast<size_t>(n), 0);
    for (int v = 0; v < n; ++v)
      if (label_[v] >= 0) {
        ++size_[label_[v]];
        at_border[label_[v]] |= borders[v];
      }
    for (int j = 0; j < mesh_.triangle_count(); ++j) {
      const auto corners = mesh_.triangles.row(j);
      if (std::all_of(corners.begin(), corners.end(), [&](int v) { return unmerged(label_[v]); }))
        continue;
      for (int v : corners) near_merges[label_[v]] = 1;
    }
    const Triangles triangles = remaining_triangles(label_);
    const VertexTriangles fans(triangles, n);
    std::vector<int> broken_fans;
    std::vector<std::pair<int, int>> links;
    for (int v = 0; v < n; ++v) {
      if (!near_merges[v] || radii_[v] == 0) continue;
      links.clear();
      for (int j : fans.of(v))
        for (int k = 0; k < 3; ++k)
          if (triangles(j, k) == v)
            links.emplace_back(triangles(j, (k + 1) % 3), triangles(j, (k + 2) % 3));
      if (!is_one_fan(links, at_border[v])) broken_fans.push_back(v);
    }
    return broken_fans;
  }

  static bool is_one_fan(std::vector<std::pair<int, int>>& links, bool open) {
    if (links.empty()) return false;
    std::sort(links.begin(), links.end());
    const auto from = [&](int vertex) {
      return std::lower_bound(links.begin(), links.end(), std::make_pair(vertex, -1));
    };
    std::vector<int> ends;
    for (size_t i = 0; i < links.size(); ++i) {
      if (i > 0 && links[i].first == links[i - 1].first) return false;
      ends.push_back(links[i].second);
    }
    std::sort(ends.begin(), ends.end());
    if (std::adjacent_find(ends.begin(), ends.end()) != ends.end()) return false;
    int start = links.front().first, starts = 0;
    for (const auto& [first, second] : links)
      if (!std::binary_search(ends.begin(), ends.end(), first)) {
        start = first;
        ++starts;
      }
    if (starts != (open ? 1 : 0)) return false;
    size_t steps = 0;
    for (int at = start;;) {
      const auto link = from(at);
      if (link == links.end() || link->first != at) break;
      ++steps;
      at = link->second;
      if (at == start) break;
    }
    return steps == links.size();
  }

  /// Undoes the merges into these centers and into their neighbours.
  void undo_merges(const std::vector<int>& centers) {
    std::vector<char> broken_fans(label_.size(), 0), undone(label_.size(), 0);
    for (int center : centers) broken_fans[center] = 1;
    for (int j = 0; j < mesh_.triangle_count(); ++j) {
      const auto corners = mesh_.triangles.row(j);
      if (!broken_fans[label_[corners[0]]] && !broken_fans[label_[corners[1]]] &&
          !broken_fans[label_[corners[2]]])
        continue;
      for (int v : corners) undone[label_[v]] = 1;
    }
    for (int v = 0; v < mesh_.vertex_count(); ++v)
      if (label_[v] >= 0 && undone[label_[v]]) label_[v] = v;
  }

  Contraction result() const {
    Contraction made;
    const int n = mesh_.vertex_count();
    std::vector<int> number(static_cast<size_t>(n), -1);
    for (int v = 0; v < n; ++v)
      if (label_[v] == v && fans_.of(v).begin() != fans_.of(v).end()) {
        number[v] = static_cast<int>(made.vertices.size());
        made.vertices.push_back(v);
      }
    for (int v = 0; v < n; ++v) made.of_vertex.push_back(label_[v] < 0 ? -1 : number[label_[v]]);
    made.triangles = remaining_triangles(made.of_vertex);
    return made;
  }

  const Mesh& mesh_;
  const std::vector<double>& radii_;
  VertexTriangles fans_;
  std::vector<int> label_, size_;  // center of each vertex; number of vertices of each center
  std::vector<double> distance_;
};

}  // namespace

Contraction contract(const Mesh& mesh, const std::vector<double>& radii) {
  return Contracting(mesh, radii).run();
}

}  // namespace dd
