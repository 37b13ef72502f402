// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/geodesic_distances.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <queue>
#include <utility>

#include "mesh/topology.h"

namespace dd {

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// The distance at c when a straight front, which has passed a and b at these distances, crosses
/// the triangle between them. Infinite when it doesn't come to c through ab.
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

std::vector<double> geodesic_distances(const Mesh& mesh, const std::vector<char>& sources,
                                       double farthest) {
  const Triangles& t = mesh.triangles;
  const size_t n = static_cast<size_t>(mesh.vertex_count());
  const Fans fans(t, mesh.vertex_count());
  const auto place = [&](int v) -> Eigen::Vector3d { return mesh.positions.row(v); };
  std::vector<double> distance(n, kInfinity);
  std::vector<int> source_of(n, -1);  // the source that a distance is measured from
  std::vector<char> passed(n, 0);
  using Front = std::pair<double, int>;
  std::priority_queue<Front, std::vector<Front>, std::greater<Front>> front;
  const auto reach = [&](int v, double value, int source) {
    if (!(value < distance[v])) return;
    distance[v] = value;
    source_of[v] = source;
    front.emplace(value, v);
  };
  for (size_t v = 0; v < n; ++v)
    if (sources[v]) reach(static_cast<int>(v), 0, static_cast<int>(v));
  // Along an edge the distance from one source is convex, so that a straight front through both
  // ends can only be late. Where the fronts of two sources meet it has a peak, which a straight one
  // would cut off: what comes through there is at least as far as the nearer source is straight.
  const auto straight = [&](int source, int c) { return (place(c) - place(source)).norm(); };
  const auto nearer = [&](int s, int other, int c) {
    return s == other || straight(s, c) <= straight(other, c) ? s : other;
  };
  while (!front.empty() && front.top().first <= farthest) {
    const int a = front.top().second;
    front.pop();
    if (passed[a]) continue;
    passed[a] = 1;
    for (int j : fans.of(a)) {
      for (int k = 0; k < 3; ++k) {
        const int c = t(j, k);
        const double along = distance[a] + (place(c) - place(a)).norm();
        if (passed[c] && !(along < distance[c])) continue;
        // An obtuse triangle may have let a front through to a after it was at c.
        passed[c] = 0;
        reach(c, along, source_of[a]);
        const int b = t(j, 0) + t(j, 1) + t(j, 2) - a - c;
        if (!passed[b]) continue;
        const int source = nearer(source_of[a], source_of[b], c);
        const double value =
            through_triangle(place(a), place(b), place(c), distance[a], distance[b]);
        reach(c, std::max(value, straight(source, c)), source);
      }
    }
  }
  return distance;
}

}  // namespace dd
