// SPDX-License-Identifier: GPL-3.0-or-later
#include "base/rotation_clusters.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <queue>
#include <utility>

#include "reconstruction/harmonic_blend.h"

namespace dd {

namespace {

// Clusters of the free surface, each with one rotation R_k: more approximate the full energy
// better, and make each step longer.
constexpr int kMaxClusters = 64;
// The same of limbs, along their length. Tuned: with 8, the turns of limbs that are led aside are
// those by 64 clusters of triangles to 2°; with 24, a flat limb doesn't converge, as its base is a
// thread, which hardly determines how a short section turns.
constexpr int kMaxLevels = 8;
// Safety: levels of harmonic functions with values from 0 to 1 that are nearer are one, and of two
// as near the first is taken, or rounding would divide a section.
constexpr double kLeastLevel = 1e-6;

/// The free vertex closest to the mean of all free ones, or −1 if none is free.
int most_central(const Positions& positions, const std::vector<char>& is_free) {
  Eigen::RowVector3d middle = Eigen::RowVector3d::Zero();
  for (size_t v = 0; v < is_free.size(); ++v)
    if (is_free[v]) middle += positions.row(Index(v));
  middle /= static_cast<double>(std::max<Index>(1, std::count(is_free.begin(), is_free.end(), 1)));
  int found = -1;
  double nearest = std::numeric_limits<double>::infinity();
  for (size_t v = 0; v < is_free.size(); ++v) {
    const double distance = (positions.row(Index(v)) - middle).squaredNorm();
    if (!is_free[v] || !(distance < nearest)) continue;
    nearest = distance;
    found = static_cast<int>(v);
  }
  return found;
}

/// Farthest-point clustering of the free vertices by shortest paths along edges (Dijkstra). The
/// first centre is the most central vertex, so that the result doesn't depend on the vertex order.
/// Returns each vertex' cluster, −1 for vertices that aren't free or that no centre reaches.
std::vector<int> farthest_point_clusters(const SparseMatrix& laplacian, const Positions& positions,
                                         const std::vector<char>& is_free, int wanted) {
  const size_t n = is_free.size();
  std::vector<double> distance(n, std::numeric_limits<double>::infinity());
  std::vector<int> cluster(n, -1);
  using Front = std::pair<double, int>;
  std::priority_queue<Front, std::vector<Front>, std::greater<Front>> front;
  for (int index = 0; index < wanted; ++index) {
    int centre = index == 0 ? most_central(positions, is_free) : -1;
    for (size_t v = 0; v < n && index > 0; ++v)
      if (is_free[v] && (centre < 0 || distance[v] > distance[centre]))
        centre = static_cast<int>(v);
    if (centre < 0 || distance[centre] == 0) break;
    front.emplace(0, centre);
    distance[centre] = 0;
    cluster[centre] = index;
    while (!front.empty()) {
      const auto [so_far, v] = front.top();
      front.pop();
      if (so_far > distance[v]) continue;
      for (SparseMatrix::InnerIterator it(laplacian, v); it; ++it) {
        const Index next = it.row();
        const double there = so_far + (positions.row(next) - positions.row(v)).norm();
        if (!is_free[next] || !(there < distance[next])) continue;
        distance[next] = there;
        cluster[next] = index;
        front.emplace(there, static_cast<int>(next));
      }
    }
  }
  return cluster;
}

/// Harmonic functions over the surface, rows in its order. Handles have different values, so that
/// the functions change along each limb between any two of them or fixed parts.
Rows level_functions(const BoundSurface& bound) {
  constexpr double kGolden = 0.6180339887498949;  // multiples of it are far apart modulo 1
  const RowOrder& order = bound.order();
  Rows values = Rows::Zero(order.count(), 4);
  for (int row = order.free_count; row < order.fixed_begin; ++row) {
    const int handle = bound.region.role[order.vertex_of_row[row]];
    for (int c = 0; c < 3; ++c) {
      const double multiple = kGolden * (handle + 1) * (c + 1);
      values(row, c) = 0.5 + 0.5 * (multiple - std::floor(multiple));
    }
  }
  extension_over(bound)(values);
  return values;
}

/// Farthest-point clustering of the marked vertices by the levels of functions. Returns each
/// vertex' level, -1 for others.
std::vector<int> levels_of(const Rows& functions, const RowOrder& order,
                           const std::vector<char>& marked) {
  std::vector<double> distance(marked.size(), std::numeric_limits<double>::infinity());
  std::vector<int> level(marked.size(), -1);
  const auto at = [&](size_t v) -> Eigen::RowVector3d {
    return functions.row(order.row_of_vertex[v]).head<3>();
  };
  const size_t none = marked.size();
  size_t centre = none;
  for (size_t v = 0; v < marked.size(); ++v)
    if (marked[v] && (centre == none || at(v).squaredNorm() > at(centre).squaredNorm())) centre = v;
  for (int index = 0; index < kMaxLevels && centre != none; ++index) {
    const Eigen::RowVector3d value = at(centre);
    size_t farthest = none;
    for (size_t v = 0; v < marked.size(); ++v) {
      if (!marked[v]) continue;
      if (const double there = (at(v) - value).norm(); there < distance[v] - kLeastLevel) {
        distance[v] = there;
        level[v] = index;
      }
      if (farthest == none || distance[v] > distance[farthest]) farthest = v;
    }
    if (distance[farthest] < kLeastLevel) break;
    centre = farthest;
  }
  return level;
}

/// Numbers the connected parts of equal levels from next on, in clusters.
void number_parts(const SparseMatrix& laplacian, const std::vector<int>& level,
                  RotationClusters& clusters) {
  for (size_t v = 0; v < level.size(); ++v) {
    if (level[v] < 0 || clusters.of[v] >= 0) continue;
    std::vector<int> front{static_cast<int>(v)};
    clusters.of[v] = clusters.count;
    for (size_t i = 0; i < front.size(); ++i)
      for (SparseMatrix::InnerIterator it(laplacian, front[i]); it; ++it) {
        const auto next = size_t(it.row());
        if (clusters.of[next] >= 0 || level[next] != level[v]) continue;
        clusters.of[next] = clusters.count;
        front.push_back(static_cast<int>(next));
      }
    ++clusters.count;
  }
}

/// The number of each handle among the free ones, -1 for others.
std::vector<int> numbers_of(const std::vector<int>& free_handles, int handle_count) {
  std::vector<int> numbers(size_t(handle_count), -1);
  for (size_t i = 0; i < free_handles.size(); ++i)
    numbers[size_t(free_handles[i])] = static_cast<int>(i);
  return numbers;
}

}  // namespace

RotationClusters triangle_clusters(const BoundSurface& bound,
                                   const std::vector<int>& free_handles) {
  const Mesh& mesh = bound.mesh;
  const Triangles& t = bound.operators.triangles;
  const Region& region = bound.region;
  const std::vector<int> own = numbers_of(free_handles, region.handle_count);
  std::vector<char> is_free(size_t(mesh.vertex_count()), 0);
  for (int v = 0; v < mesh.vertex_count(); ++v) is_free[v] = region.role[v] == kFree;
  std::vector<int> vertex_cluster;
  if (!bound.outside_base())
    vertex_cluster =
        farthest_point_clusters(bound.operators.laplacian, mesh.positions, is_free, kMaxClusters);
  RotationClusters clusters;
  clusters.count = static_cast<int>(free_handles.size());
  clusters.of.assign(size_t(mesh.triangle_count()), -1);
  for (int j = 0; j < mesh.triangle_count(); ++j) {
    int found = -1;
    for (int k = 0; k < 3; ++k) {
      const int v = t(j, k), role = region.role[v];
      if (role >= 0 && own[role] >= 0) {
        found = own[role];
        break;
      }
      if (found < 0 && !vertex_cluster.empty() && vertex_cluster[v] >= 0)
        found = static_cast<int>(free_handles.size()) + vertex_cluster[v];
    }
    clusters.of[j] = found;
    clusters.count = std::max(clusters.count, found + 1);
  }
  return clusters;
}

RotationClusters vertex_clusters(const BoundSurface& bound, const std::vector<int>& free_handles,
                                 const Eigen::VectorXd& limbs) {
  const SparseMatrix& laplacian = bound.operators.laplacian;
  const Region& region = bound.region;
  const auto n = size_t(bound.mesh.vertex_count());
  std::vector<char> of_limbs(n, 0), others(n, 0);
  for (int v : region.free) (limbs[v] > 0.5 ? of_limbs : others)[size_t(v)] = 1;
  RotationClusters clusters;
  clusters.count = static_cast<int>(free_handles.size());
  clusters.of.assign(n, -1);
  number_parts(laplacian, levels_of(level_functions(bound), bound.order(), of_limbs), clusters);
  const int first = clusters.count;
  const std::vector<int> of_others =
      farthest_point_clusters(laplacian, bound.mesh.positions, others, kMaxClusters);
  const std::vector<int> own = numbers_of(free_handles, region.handle_count);
  for (size_t v = 0; v < n; ++v) {
    if (of_others[v] >= 0) clusters.of[v] = first + of_others[v];
    if (const int role = region.role[v]; role >= 0 && own[size_t(role)] >= 0)
      clusters.of[v] = own[size_t(role)];
    clusters.count = std::max(clusters.count, clusters.of[v] + 1);
  }
  return clusters;
}

}  // namespace dd
