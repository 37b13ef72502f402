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

/// The distance at c by a straight front with these distances at a and b that crosses the triangle.
/// Infinite if the front doesn't reach c through the edge ab.
double through_triangle(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                        const Eigen::Vector3d& c, double at_a, double at_b) {
  const Eigen::Vector3d edge = b - a, arm = c - a;
  const double length = edge.norm();
  const double along = arm.dot(edge) / length, across = (arm - along / length * edge).norm();
  // Derivative of the distance along ab; ±1 if ab is perpendicular to the front.
  const double slope = (at_b - at_a) / length;
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
  const VertexTriangles fans(t, mesh.vertex_count());
  const auto position = [&](int v) -> Eigen::Vector3d { return mesh.positions.row(v); };
  std::vector<double> distance(n, kInfinity);
  std::vector<int> source_of(n, -1);  // nearest source, to which distance refers
  std::vector<char> passed(n, 0);
  using Front = std::pair<double, int>;
  std::priority_queue<Front, std::vector<Front>, std::greater<Front>> front;
  const auto lower_distance = [&](int v, double value, int source) {
    if (!(value < distance[v])) return;
    distance[v] = value;
    source_of[v] = source;
    front.emplace(value, v);
  };
  for (size_t v = 0; v < n; ++v)
    if (sources[v]) lower_distance(static_cast<int>(v), 0, static_cast<int>(v));
  // Along an edge the distance from one source is convex, so a straight front through both ends
  // only overestimates it. Where the fronts of two sources meet it has a peak, which a straight
  // front cuts off: there the straight-line distance to the nearer source is a lower bound.
  const auto straight = [&](int source, int c) { return (position(c) - position(source)).norm(); };
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
        const double along = distance[a] + (position(c) - position(a)).norm();
        if (passed[c] && !(along < distance[c])) continue;
        // Reopens c: through an obtuse triangle the front may have reached a late, after c.
        passed[c] = 0;
        lower_distance(c, along, source_of[a]);
        const int b = t(j, 0) + t(j, 1) + t(j, 2) - a - c;
        if (!passed[b]) continue;
        const int source = nearer(source_of[a], source_of[b], c);
        const double value =
            through_triangle(position(a), position(b), position(c), distance[a], distance[b]);
        lower_distance(c, std::max(value, straight(source, c)), source);
      }
    }
  }
  return distance;
}

}  // namespace dd
