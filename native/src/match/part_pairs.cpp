// SPDX-License-Identifier: GPL-3.0-or-later
#include "match/part_pairs.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "mesh/topology.h"
#include "mesh/triangles.h"
#include "mesh/unit_box.h"
#include "support/assignment.h"

namespace dd {

namespace {

// Parts that are numbered: bounds the time of the assignment, which is cubic in their number.
constexpr int kMaxNumberedParts = 128;
// A part is much nearer than another one below this fraction of its distance.
constexpr double kMuchNearerRatio = 0.7;
// Distance of two parts below which they may correspond in any case, as a fraction of the diagonal
// of the larger box.
constexpr double kAlwaysPairedDistance = 0.005;
// As a fraction of that diagonal, too: the largest distance of parts that are paired by the
// assignment, and of closest points that are preferred for being on a part that may correspond.
constexpr double kPreferredDistance = 0.03;
// Parts are alike if their distance with coinciding means is below this fraction of the smaller
// one's size √tr C.
constexpr double kMaxUnlikeness = 0.3;

/// A part's area and its distribution; root: C^½.
struct AreaDistribution {
  double area = 0;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero(), root = covariance;
};

Eigen::Matrix3d root_of(const Eigen::Matrix3d& matrix) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(matrix);
  return axes.eigenvectors() * axes.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal() *
         axes.eigenvectors().transpose();
}

std::vector<AreaDistribution> distributions_of(const Mesh& mesh, const LooseParts& parts) {
  std::vector<AreaDistribution> found(static_cast<size_t>(parts.count));
  const Eigen::VectorXd areas = triangle_areas(mesh.positions, mesh.triangles);
  const auto of_each = [&](const auto& add) {
    for (Index j = 0; j < areas.size(); ++j)
      if (const int part = parts.of_vertex[size_t(mesh.triangles(j, 0))]; part >= 0)
        add(found[size_t(part)], j);
  };
  of_each([&](AreaDistribution& distribution, Index j) {
    distribution.area += areas[j];
    distribution.mean += areas[j] * triangle_centre(mesh.positions, mesh.triangles, j);
  });
  for (AreaDistribution& distribution : found)
    if (distribution.area > 0) distribution.mean /= distribution.area;
  of_each([&](AreaDistribution& distribution, Index j) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d corner =
          mesh.positions.row(mesh.triangles(j, k)).transpose() - distribution.mean;
      distribution.covariance += areas[j] / 12 * corner * corner.transpose();
      sum += corner;
    }
    distribution.covariance += areas[j] / 12 * sum * sum.transpose();
  });
  for (AreaDistribution& distribution : found) {
    if (distribution.area > 0) distribution.covariance /= distribution.area;
    distribution.root = root_of(distribution.covariance);
  }
  return found;
}

double wasserstein_distance(const AreaDistribution& one, const AreaDistribution& other) {
  const double squared = (one.mean - other.mean).squaredNorm() + one.covariance.trace() +
                         other.covariance.trace() -
                         2 * root_of(one.root * other.covariance * one.root).trace();
  return std::sqrt(std::max(squared, 0.0));
}

/// Whether two parts have like shapes, wherever they are.
bool are_alike(const AreaDistribution& one, AreaDistribution other) {
  other.mean = one.mean;
  const double size = std::sqrt(std::min(one.covariance.trace(), other.covariance.trace()));
  return wasserstein_distance(one, other) < kMaxUnlikeness * size;
}

}  // namespace

LooseParts::LooseParts(const Mesh& mesh) {
  const Components parts(mesh.triangles, mesh.vertex_count());
  const Eigen::VectorXd areas = triangle_areas(mesh.positions, mesh.triangles);
  std::vector<double> part_areas(static_cast<size_t>(parts.count), 0.0);
  for (Index j = 0; j < areas.size(); ++j)
    part_areas[size_t(parts.of_vertex[size_t(mesh.triangles(j, 0))])] += areas[j];
  std::vector<int> ordered(part_areas.size()), part_number(part_areas.size(), -1);
  std::iota(ordered.begin(), ordered.end(), 0);
  std::stable_sort(ordered.begin(), ordered.end(),
                   [&](int a, int b) { return part_areas[size_t(a)] > part_areas[size_t(b)]; });
  for (int part : ordered)
    if (count < kMaxNumberedParts && part_areas[size_t(part)] > 0)
      part_number[size_t(part)] = count++;
  for (int part : parts.of_vertex) of_vertex.push_back(part_number[size_t(part)]);
}

PartPairs::PartPairs(const Mesh& mesh, const LooseParts& parts, const Mesh& other,
                     const LooseParts& parts_of_other)
    : triangles_(other.triangles),
      part_of_vertex_(parts.of_vertex),
      part_of_other_vertex_(parts_of_other.of_vertex),
      other_part_count_(parts_of_other.count) {
  if (parts.count < 2 || other_part_count_ < 2) return;
  const double box =
      std::max(bounding_box_diagonal(mesh.positions), bounding_box_diagonal(other.positions));
  preferred_distance_ = kPreferredDistance * box;
  const std::vector<AreaDistribution> distributions = distributions_of(mesh, parts),
                                      other_distributions = distributions_of(other, parts_of_other);
  Eigen::MatrixXd part_distances(parts.count, other_part_count_);
  for (Index s = 0; s < part_distances.rows(); ++s)
    for (Index t = 0; t < part_distances.cols(); ++t)
      part_distances(s, t) =
          wasserstein_distance(distributions[size_t(s)], other_distributions[size_t(t)]);
  const Eigen::VectorXd nearest = part_distances.rowwise().minCoeff();
  const Eigen::RowVectorXd nearest_to_other = part_distances.colwise().minCoeff();
  may_correspond_.resize(static_cast<size_t>(part_distances.size()));
  for (Index s = 0; s < part_distances.rows(); ++s)
    for (Index t = 0; t < part_distances.cols(); ++t)
      may_correspond_[size_t(s * other_part_count_ + t)] =
          kMuchNearerRatio * part_distances(s, t) <
          std::max(
              {nearest[s], nearest_to_other[t], kMuchNearerRatio * kAlwaysPairedDistance * box});
  // Among parts that are assigned to one of like shape, only assigned pairs may correspond.
  const std::vector<int> assigned = min_cost_assignment(part_distances.cwiseAbs2());
  std::vector<Index> alike, other_alike;
  for (Index s = 0; s < part_distances.rows(); ++s) {
    const int t = assigned[size_t(s)];
    if (t < 0 || part_distances(s, t) > preferred_distance_ ||
        !are_alike(distributions[size_t(s)], other_distributions[size_t(t)]))
      continue;
    alike.push_back(s);
    other_alike.push_back(t);
  }
  for (Index s : alike)
    for (Index t : other_alike)
      may_correspond_[size_t(s * other_part_count_ + t)] = assigned[size_t(s)] == t;
}

PointOnTriangle PartPairs::nearest_facing(const AabbTree& tree, int vertex,
                                          const Eigen::Vector3d& point,
                                          const Eigen::Vector3d& normal, double reach) const {
  const int part = part_of_vertex_[size_t(vertex)];
  if (may_correspond_.empty() || part < 0) return tree.nearest_facing(point, normal, reach);
  const PointOnTriangle found =
      tree.nearest_facing(point, normal, std::min(reach, preferred_distance_), [&](int j) {
        const int there = part_of_other_vertex_[size_t(triangles_(j, 0))];
        return there < 0 ||
               may_correspond_[size_t(part) * size_t(other_part_count_) + size_t(there)] != 0;
      });
  return found.triangle >= 0 ? found : tree.nearest_facing(point, normal, reach);
}

}  // namespace dd
