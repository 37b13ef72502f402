// SPDX-License-Identifier: GPL-3.0-or-later
#include "match/fit_goals.h"

#include <algorithm>
#include <utility>

#include "match/robust_statistics.h"
#include "mesh/triangles.h"

namespace dd {

namespace {

// Weight of a vertex without a closest point where others have one. Safety: at 0 an open sheet
// creeps onto a border.
constexpr double kWeightWithoutGoal = 0.05;
// Multiple of the median distance at which the weight is 1/4: with a larger one, parts without a
// counterpart drag the rest along; with a smaller one, posed parts are left behind.
constexpr double kOutlierMedians = 8;

/// Whether a point of a triangle lies on a border. Safety: rounding leaves weights of points on an
/// edge below 1e-9, but not at 0.
bool at_border(const Borders& borders, const PointOnTriangle& point) {
  for (int k = 0; k < 3; ++k)  // edge k is opposite to corner k + 2
    if (point.barycentric[(k + 2) % 3] < 1e-9 &&
        borders.half_edges[3 * static_cast<size_t>(point.triangle) + k])
      return true;
  return false;
}

/// For each vertex of a mesh, the closest point of another one within reach; triangle −1: none.
std::vector<PointOnTriangle> nearest_points_of(const Mesh& mesh, const Positions& normals,
                                               const AabbTree& other, const PartPairs& pairs,
                                               double reach, ThreadPool& pool) {
  std::vector<PointOnTriangle> found(static_cast<size_t>(mesh.vertex_count()));
  pool.parallel_for(mesh.vertex_count(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (int64_t v = begin; v < end; ++v)
      found[size_t(v)] =
          pairs.nearest_facing(other, static_cast<int>(v), mesh.positions.row(v).transpose(),
                               normals.row(v).transpose(), reach);
  });
  return found;
}

}  // namespace

Eigen::VectorXd FitGoals::robust_weights(const Positions& now, double least) const {
  const Eigen::VectorXd distances = (positions - now).rowwise().norm();
  std::vector<double> goal_distances;
  for (Index v = 0; v < now.rows(); ++v)
    if (found[size_t(v)] == Found::goal) goal_distances.push_back(distances[v]);
  if (goal_distances.empty()) return Eigen::VectorXd::Ones(now.rows());
  const double quarter_distance =
      std::max(kOutlierMedians * median(std::move(goal_distances)), least);
  Eigen::VectorXd result = Eigen::VectorXd::Constant(now.rows(), kWeightWithoutGoal);
  for (Index v = 0; v < now.rows(); ++v)
    if (found[size_t(v)] != Found::none)
      result[v] = geman_mcclure_weight(distances[v] / quarter_distance);
  return result;
}

GoalFinder::GoalFinder(const Mesh& source, const Mesh& target, double reach, ThreadPool& pool)
    : target_(target),
      pool_(pool),
      reach_(reach),
      tree_(target),
      source_parts_(source),
      target_parts_(target),
      source_borders_(source.triangles, source.vertex_count()),
      target_borders_(target.triangles, target.vertex_count()),
      target_normals_(summed_normals(target.positions, target.triangles)) {}

FitGoals GoalFinder::nearest(const Mesh& now) const {
  return nearest(now, summed_normals(now.positions, now.triangles));
}

FitGoals GoalFinder::nearest(const Mesh& now, const Positions& normals) const {
  const std::vector<PointOnTriangle> points = nearest_points_of(
      now, normals, tree_, PartPairs(now, source_parts_, target_, target_parts_), reach_, pool_);
  FitGoals result = {now.positions, std::vector<FitGoals::Found>(points.size())};
  for (size_t v = 0; v < points.size(); ++v) {
    if (points[v].triangle < 0) continue;
    const bool beyond = at_border(target_borders_, points[v]) && !source_borders_.vertices[v];
    result.found[v] = beyond ? FitGoals::Found::border : FitGoals::Found::goal;
    if (!beyond) result.positions.row(Index(v)) = points[v].position.transpose();
  }
  return result;
}

FitGoals GoalFinder::both_ways(const Mesh& now) const {
  const Positions normals = summed_normals(now.positions, now.triangles);
  FitGoals result = nearest(now, normals);
  const std::vector<PointOnTriangle> points =
      nearest_points_of(target_, target_normals_, AabbTree(now),
                        PartPairs(target_, target_parts_, now, source_parts_), reach_, pool_);
  Positions offset_sums = Positions::Zero(now.vertex_count(), 3);
  Eigen::VectorXd weights = Eigen::VectorXd::Zero(now.vertex_count());
  for (size_t v = 0; v < points.size(); ++v) {
    const PointOnTriangle& there = points[v];
    if (there.triangle < 0 || (at_border(source_borders_, there) && !target_borders_.vertices[v]))
      continue;
    const double area = target_normals_.row(Index(v)).norm();
    for (int k = 0; k < 3; ++k) {
      const int corner = now.triangles(there.triangle, k);
      const double weight = area * std::max(there.barycentric[size_t(k)], 0.0);
      weights[corner] += weight;
      offset_sums.row(corner) +=
          weight * (target_.positions.row(Index(v)) - there.position.transpose());
    }
  }
  for (int v = 0; v < now.vertex_count(); ++v) {
    const double reverse_weight =
        std::min(1.0, weights[v] / std::max(normals.row(v).norm(), 1e-300));
    if (!(reverse_weight > 0)) continue;
    const double own = result.found[size_t(v)] == FitGoals::Found::goal ? 1 : 0;
    const Eigen::RowVector3d offset = own * (result.positions.row(v) - now.positions.row(v)) +
                                      reverse_weight / weights[v] * offset_sums.row(v);
    result.positions.row(v) = now.positions.row(v) + offset / (own + reverse_weight);
    result.found[size_t(v)] = FitGoals::Found::goal;
  }
  return result;
}

}  // namespace dd
