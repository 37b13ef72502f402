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
constexpr int kLargest = 128;
// A part is much nearer than another one below this fraction of its distance.
constexpr double kMuchNearer = 0.7;
// Distance of two parts below which they may correspond in any case, as a fraction of the diagonal
// of the larger box.
constexpr double kTooNear = 0.005;
// As a fraction of that diagonal, too: the largest distance of parts that are paired by the
// assignment, and of closest points that are preferred for being on a part that may correspond.
constexpr double kNextTo = 0.03;
// Parts are alike if their distance with coinciding means is below this fraction of the smaller
// one's size √tr C.
constexpr double kUnlike = 0.3;

/// A part's area and its distribution; root: C^½.
struct Spread {
  double area = 0;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero(), root = covariance;
};

Eigen::Matrix3d root_of(const Eigen::Matrix3d& matrix) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(matrix);
  return axes.eigenvectors() * axes.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal() *
         axes.eigenvectors().transpose();
}

std::vector<Spread> spreads_of(const Mesh& mesh, const LooseParts& parts) {
  std::vector<Spread> found(static_cast<size_t>(parts.count));
  const Eigen::VectorXd areas = triangle_areas(mesh.positions, mesh.triangles);
  const auto of_each = [&](const auto& add) {
    for (Index j = 0; j < areas.size(); ++j)
      if (const int part = parts.of_vertex[size_t(mesh.triangles(j, 0))]; part >= 0)
        add(found[size_t(part)], j);
  };
  of_each([&](Spread& spread, Index j) {
    spread.area += areas[j];
    spread.mean += areas[j] * triangle_centre(mesh.positions, mesh.triangles, j);
  });
  for (Spread& spread : found)
    if (spread.area > 0) spread.mean /= spread.area;
  of_each([&](Spread& spread, Index j) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d corner =
          mesh.positions.row(mesh.triangles(j, k)).transpose() - spread.mean;
      spread.covariance += areas[j] / 12 * corner * corner.transpose();
      sum += corner;
    }
    spread.covariance += areas[j] / 12 * sum * sum.transpose();
  });
  for (Spread& spread : found) {
    if (spread.area > 0) spread.covariance /= spread.area;
    spread.root = root_of(spread.covariance);
  }
  return found;
}

double distance(const Spread& one, const Spread& other) {
  const double apart = (one.mean - other.mean).squaredNorm() + one.covariance.trace() +
                       other.covariance.trace() -
                       2 * root_of(one.root * other.covariance * one.root).trace();
  return std::sqrt(std::max(apart, 0.0));
}

/// Whether two parts have like shapes, wherever they are.
bool are_alike(const Spread& one, Spread other) {
  other.mean = one.mean;
  const double size = std::sqrt(std::min(one.covariance.trace(), other.covariance.trace()));
  return distance(one, other) < kUnlike * size;
}

}  // namespace

LooseParts::LooseParts(const Mesh& mesh) {
  const Components parts(mesh.triangles, mesh.vertex_count());
  const Eigen::VectorXd areas = triangle_areas(mesh.positions, mesh.triangles);
  std::vector<double> of_parts(static_cast<size_t>(parts.count), 0.0);
  for (Index j = 0; j < areas.size(); ++j)
    of_parts[size_t(parts.of_vertex[size_t(mesh.triangles(j, 0))])] += areas[j];
  std::vector<int> ordered(of_parts.size()), number(of_parts.size(), -1);
  std::iota(ordered.begin(), ordered.end(), 0);
  std::stable_sort(ordered.begin(), ordered.end(),
                   [&](int a, int b) { return of_parts[size_t(a)] > of_parts[size_t(b)]; });
  for (int part : ordered)
    if (count < kLargest && of_parts[size_t(part)] > 0) number[size_t(part)] = count++;
  for (int part : parts.of_vertex) of_vertex.push_back(number[size_t(part)]);
}

PartPairs::PartPairs(const Mesh& mesh, const LooseParts& parts, const Mesh& other,
                     const LooseParts& parts_of_other)
    : triangles_(other.triangles),
      own_(parts.of_vertex),
      others_(parts_of_other.of_vertex),
      count_(parts_of_other.count) {
  if (parts.count < 2 || count_ < 2) return;
  const double box =
      std::max(bounding_box_diagonal(mesh.positions), bounding_box_diagonal(other.positions));
  near_ = kNextTo * box;
  const std::vector<Spread> spreads = spreads_of(mesh, parts),
                            others = spreads_of(other, parts_of_other);
  Eigen::MatrixXd apart(parts.count, count_);
  for (Index s = 0; s < apart.rows(); ++s)
    for (Index t = 0; t < apart.cols(); ++t)
      apart(s, t) = distance(spreads[size_t(s)], others[size_t(t)]);
  const Eigen::VectorXd nearest = apart.rowwise().minCoeff();
  const Eigen::RowVectorXd nearest_to_other = apart.colwise().minCoeff();
  may_.resize(static_cast<size_t>(apart.size()));
  for (Index s = 0; s < apart.rows(); ++s)
    for (Index t = 0; t < apart.cols(); ++t)
      may_[size_t(s * count_ + t)] =
          kMuchNearer * apart(s, t) <
          std::max({nearest[s], nearest_to_other[t], kMuchNearer * kTooNear * box});
  // Among parts that are assigned to one of like shape, only assigned pairs may correspond.
  const std::vector<int> likes = least_assignment(apart.cwiseAbs2());
  std::vector<Index> alike, others_alike;
  for (Index s = 0; s < apart.rows(); ++s) {
    const int t = likes[size_t(s)];
    if (t < 0 || apart(s, t) > near_ || !are_alike(spreads[size_t(s)], others[size_t(t)])) continue;
    alike.push_back(s);
    others_alike.push_back(t);
  }
  for (Index s : alike)
    for (Index t : others_alike) may_[size_t(s * count_ + t)] = likes[size_t(s)] == t;
}

PointOnTriangle PartPairs::nearest_facing(const AabbTree& tree, int vertex,
                                          const Eigen::Vector3d& point,
                                          const Eigen::Vector3d& normal, double reach) const {
  const int part = own_[size_t(vertex)];
  if (may_.empty() || part < 0) return tree.nearest_facing(point, normal, reach);
  const PointOnTriangle found =
      tree.nearest_facing(point, normal, std::min(reach, near_), [&](int j) {
        const int there = others_[size_t(triangles_(j, 0))];
        return there < 0 || may_[size_t(part) * size_t(count_) + size_t(there)] != 0;
      });
  return found.triangle >= 0 ? found : tree.nearest_facing(point, normal, reach);
}

}  // namespace dd
