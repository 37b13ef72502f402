// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/distances.h"

#include <cmath>
#include <functional>
#include <limits>
#include <queue>
#include <utility>

namespace dd {

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// What a front that has passed a and b brings to c: that of a straight one, where it crosses the
/// triangle between them.
double through_triangle(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                        const Eigen::Vector3d& c, double at_a, double at_b) {
  const Eigen::Vector3d edge = b - a, arm = c - a;
  const double length = edge.norm();
  const double along = arm.dot(edge) / length, across = (arm - along / length * edge).norm();
  const double slope = (at_b - at_a) / length;  // of the distance along ab; 1 across the front
  if (!(std::abs(slope) < 1)) return kInfinity;
  const double climb = std::sqrt(1 - slope * slope);
  const double entered = along - across * slope / climb;
  if (entered < 0 || entered > length) return kInfinity;
  return at_a + slope * along + climb * across;
}

}  // namespace

std::vector<double> surface_distances(const Mesh& mesh, const std::vector<char>& sources) {
  const Triangles& t = mesh.triangles;
  const size_t n = static_cast<size_t>(mesh.vertex_count());
  std::vector<int> begin(n + 1, 0), fan(static_cast<size_t>(t.size()));
  for (Index k = 0; k < t.size(); ++k) ++begin[t.data()[k] + 1];
  for (size_t v = 0; v < n; ++v) begin[v + 1] += begin[v];
  std::vector<int> filled(begin.begin(), begin.end() - 1);
  for (Index k = 0; k < t.size(); ++k) fan[filled[t.data()[k]]++] = static_cast<int>(k / 3);

  const auto place = [&](int v) -> Eigen::Vector3d { return mesh.positions.row(v); };
  std::vector<double> distance(n, kInfinity);
  std::vector<char> passed(n, 0);
  using Front = std::pair<double, int>;
  std::priority_queue<Front, std::vector<Front>, std::greater<Front>> front;
  const auto reach = [&](int v, double value) {
    if (!(value < distance[v])) return;
    distance[v] = value;
    front.emplace(value, v);
  };
  for (size_t v = 0; v < n; ++v)
    if (sources[v]) reach(static_cast<int>(v), 0);
  while (!front.empty()) {
    const int a = front.top().second;
    front.pop();
    if (passed[a]) continue;
    passed[a] = 1;
    for (int i = begin[a]; i < begin[a + 1]; ++i) {
      for (int k = 0; k < 3; ++k) {
        const int c = t(fan[i], k);
        if (passed[c]) continue;
        reach(c, distance[a] + (place(c) - place(a)).norm());
        const int b = t(fan[i], 0) + t(fan[i], 1) + t(fan[i], 2) - a - c;
        if (passed[b])
          reach(c, through_triangle(place(a), place(b), place(c), distance[a], distance[b]));
      }
    }
  }
  return distance;
}

}  // namespace dd
