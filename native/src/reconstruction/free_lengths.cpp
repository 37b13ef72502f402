// SPDX-License-Identifier: GPL-3.0-or-later
#include "reconstruction/free_lengths.h"

#include <functional>
#include <queue>
#include <tuple>
#include <vector>

namespace dd {

FreeLengths free_lengths(const FactoredSurface& surface) {
  const PoissonSystem& poisson = *surface.poisson;
  const Mesh& mesh = surface.mesh;
  const int count = poisson.active_vertex_count();
  struct Neighbour {
    int index;
    double length;
  };
  std::vector<std::vector<Neighbour>> neighbours(static_cast<size_t>(count));
  for (int j : surface.faces_with_free_corners())
    for (int k = 0; k < 3; ++k) {
      const int v = mesh.triangles(j, k), w = mesh.triangles(j, (k + 1) % 3);
      const int a = poisson.active_index_of_vertex(v), b = poisson.active_index_of_vertex(w);
      if (a < 0 || b < 0) continue;
      const double length = (mesh.positions.row(v) - mesh.positions.row(w)).norm();
      neighbours[size_t(a)].push_back({b, length});
      neighbours[size_t(b)].push_back({a, length});
    }
  // Dijkstra's algorithm; each vertex is reached twice, by two roles.
  struct Reached {
    int times = 0;
    int role = 0;       // of the first time
    double depth = 0;   // its distance
    double length = 0;  // the sum of both distances
    bool wants(int by) const { return times == 0 || (times == 1 && role != by); }
  };
  std::vector<Reached> reached(static_cast<size_t>(count));
  using Entry = std::tuple<double, int, int>;  // distance, role, index
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> front;
  for (int i = surface.order().free_count; i < count; ++i)
    front.emplace(0.0, surface.region.role[size_t(poisson.active_vertex(i))], i);
  while (!front.empty()) {
    const auto [distance, role, index] = front.top();
    front.pop();
    Reached& here = reached[size_t(index)];
    if (!here.wants(role)) continue;
    if (here.times++ == 0) here.role = role, here.depth = distance;
    here.length += distance;
    for (const Neighbour& next : neighbours[size_t(index)])
      if (reached[size_t(next.index)].wants(role))
        front.emplace(distance + next.length, role, next.index);
  }
  FreeLengths found{Eigen::VectorXd::Zero(count), Eigen::VectorXd::Zero(count)};
  for (int i = 0; i < count; ++i) {
    const Reached& here = reached[size_t(i)];
    found.depths[i] = here.depth;
    if (here.times == 2) found.lengths[i] = here.length;
  }
  return found;
}

}  // namespace dd
