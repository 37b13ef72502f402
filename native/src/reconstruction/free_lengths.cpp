// SPDX-License-Identifier: GPL-3.0-or-later
#include "reconstruction/free_lengths.h"

#include <functional>
#include <limits>
#include <numeric>
#include <queue>
#include <utility>

namespace dd {

FreeLengths free_lengths(const FactoredSurface& surface) {
  const PoissonSystem& poisson = *surface.poisson;
  const Mesh& mesh = surface.mesh;
  std::vector<std::tuple<int, int, double>> edges;
  for (int j : surface.faces_with_free_corners())
    for (int k = 0; k < 3; ++k) {
      const int v = mesh.triangles(j, k), w = mesh.triangles(j, (k + 1) % 3);
      const int a = poisson.active_index_of_vertex(v), b = poisson.active_index_of_vertex(w);
      if (a < 0 || b < 0) continue;
      edges.emplace_back(a, b, (mesh.positions.row(v) - mesh.positions.row(w)).norm());
    }
  std::vector<int> rim_roles;
  for (int row : poisson.rims())
    rim_roles.push_back(surface.region.role[size_t(surface.order().vertex_of_row[size_t(row)])]);
  return free_lengths(surface.order().free_count, rim_roles, edges);
}

FreeLengths free_lengths(int free_count, const std::vector<int>& rim_roles,
                         const std::vector<std::tuple<int, int, double>>& edges) {
  const int count = free_count + static_cast<int>(rim_roles.size());
  struct Neighbour {
    int index;
    double length;
  };
  // Neighbours of vertex i: from begin[i] to begin[i + 1], twice where two faces meet.
  std::vector<int> begin(size_t(count) + 1, 0);
  for (const auto& [a, b, length] : edges) {
    ++begin[size_t(a) + 1];
    ++begin[size_t(b) + 1];
  }
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  std::vector<Neighbour> neighbours(2 * edges.size());
  std::vector<int> next = begin;
  for (const auto& [a, b, length] : edges) {
    neighbours[size_t(next[size_t(a)]++)] = {b, length};
    neighbours[size_t(next[size_t(b)]++)] = {a, length};
  }
  // Dijkstra's algorithm with two labels: each vertex is reached from the nearest role and from the
  // nearest other one.
  struct Label {
    double distance = std::numeric_limits<double>::infinity();
    int role = kFree;  // none, as rims have others
    bool is_reached() const { return role != kFree; }
  };
  struct Labels {
    Label nearest, other;
    /// Whether that is nearer than what was known.
    bool improve(const Label& by) {
      Label& known = by.role == nearest.role ? nearest : other;
      if (!(by.distance < known.distance)) return false;
      known = by;
      if (other.distance < nearest.distance) std::swap(nearest, other);
      return true;
    }
    double of(int role) const { return role == nearest.role ? nearest.distance : other.distance; }
  };
  std::vector<Labels> labels(static_cast<size_t>(count));
  using Entry = std::tuple<double, int, int>;  // distance, role, index
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> front;
  const auto reach = [&](int index, const Label& by) {
    if (labels[size_t(index)].improve(by)) front.emplace(by.distance, by.role, index);
  };
  for (int i = free_count; i < count; ++i) reach(i, {0, rim_roles[size_t(i - free_count)]});
  while (!front.empty()) {
    const auto [distance, role, index] = front.top();
    front.pop();
    if (distance > labels[size_t(index)].of(role)) continue;  // a nearer way was found since
    for (int n = begin[size_t(index)]; n < begin[size_t(index) + 1]; ++n)
      reach(neighbours[size_t(n)].index, {distance + neighbours[size_t(n)].length, role});
  }
  FreeLengths found{Eigen::VectorXd::Zero(count), Eigen::VectorXd::Zero(count)};
  for (int i = 0; i < count; ++i) {
    const auto& [nearest, other] = labels[size_t(i)];
    if (nearest.is_reached()) found.depths[i] = nearest.distance;
    if (other.is_reached()) found.lengths[i] = nearest.distance + other.distance;
  }
  return found;
}

}  // namespace dd
