// SPDX-License-Identifier: GPL-3.0-or-later
#include "methods/normal_displacement.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <queue>
#include <utility>

#include "base/base_surface.h"
#include "reconstruction/whole_surface.h"

namespace dd {

namespace {

using Eigen::Vector3d;

// Newton's method for a projection: limit on steps, of which it takes a few; change of w₁, w₂ and h
// together in the last step, which is rounding; largest distance of the point found, in the unit
// box; |w₁| + |w₂| from which on the iteration has diverged.
constexpr int kMaxProjectionSteps = 20;
constexpr double kLastProjectionStep = 1e-14, kMaxProjectionError = 1e-12, kMaxBarycentricSum = 10;
// Triangles visited in the search for a vertex' projection: bounds its time.
constexpr int kMaxVisitedTriangles = 400;
// Tolerance of barycentric weights: without it rounding loses points over a shared edge.
constexpr double kBarycentricTolerance = 1e-9;
// Safety, absolute in the unit box: shorter vectors are rounding and have no direction. Of cross
// products of edges, squared, where only the division must not overflow; of sums of these around a
// vertex; of edges, and of interpolated unit vectors; of normals that a height is divided by.
constexpr double kMinSquaredCross = 1e-60, kMinSummedCross = 1e-13, kMinDirection = 1e-9,
                 kMinDividedNormal = 1e-150;

Vector3d vector3(const Rows& rows, int row) { return rows.row(row).head<3>(); }

/// The triangles that share a vertex with a triangle with a free corner, their corners as rows:
/// those that vertices may be projected onto, and their neighbours, which the normals need.
Triangles triangles_near_free(const BoundSurface& bound) {
  const Triangles& t = bound.mesh.triangles;
  std::vector<char> near(bound.region.role.size(), 0);
  for (int j : bound.faces_with_free_corners())
    for (int k = 0; k < 3; ++k) near[t(j, k)] = 1;
  std::vector<int> chosen;
  for (int j = 0; j < bound.mesh.triangle_count(); ++j)
    if (near[t(j, 0)] || near[t(j, 1)] || near[t(j, 2)]) chosen.push_back(j);
  Triangles rows(static_cast<Index>(chosen.size()), 3);
  for (size_t i = 0; i < chosen.size(); ++i)
    for (int k = 0; k < 3; ++k) rows(Index(i), k) = bound.order().row_of_vertex[t(chosen[i], k)];
  return rows;
}

/// A projection b of the point b + h n(b) over a triangle: barycentric weights w₁, w₂ of b (w₀ = 1
/// − w₁ − w₂), height h.
struct Projection {
  double w1, w2, height;
  Vector3d normal;
  Eigen::Matrix3d jacobian;  // of position by w₁, w₂ and h
  Vector3d position;
};

/// A triangle of the carrier with vertex normals: the points b + h n(b) over it.
struct NormalPrism {
  Vector3d q0, q1, q2, n0, n1, n2;

  Projection at(double w1, double w2, double height) const {
    Projection projection;
    projection.w1 = w1, projection.w2 = w2, projection.height = height;
    const Vector3d n = n0 + w1 * (n1 - n0) + w2 * (n2 - n0);
    const double length = n.norm();
    projection.normal = n / length;
    const auto turn = [&](const Vector3d& change) {
      return Vector3d((change - projection.normal * projection.normal.dot(change)) / length);
    };
    projection.jacobian.col(0) = q1 - q0 + height * turn(n1 - n0);
    projection.jacobian.col(1) = q2 - q0 + height * turn(n2 - n0);
    projection.jacobian.col(2) = projection.normal;
    projection.position = q0 + w1 * (q1 - q0) + w2 * (q2 - q0) + height * projection.normal;
    return projection;
  }
};

/// Finds the projection of a point by Newton's method. False if it runs far out of the
/// triangle, doesn't converge, or converges beyond the centre of curvature, where the prism is
/// inverted.
bool find_projection(const NormalPrism& prism, const Vector3d& point, Projection& projection) {
  const Vector3d e1 = prism.q1 - prism.q0, e2 = prism.q2 - prism.q0, cross = e1.cross(e2);
  const double squared = cross.squaredNorm();
  if (!(squared > kMinSquaredCross)) return false;
  const Vector3d arm = point - prism.q0;
  projection = prism.at(arm.cross(e2).dot(cross) / squared, e1.cross(arm).dot(cross) / squared,
                        arm.dot(cross) / std::sqrt(squared));
  for (int step = 0; step < kMaxProjectionSteps; ++step) {
    if (!(std::abs(projection.w1) + std::abs(projection.w2) < kMaxBarycentricSum)) return false;
    const Vector3d change = projection.jacobian.inverse() * (point - projection.position);
    if (!change.allFinite()) return false;
    projection = prism.at(projection.w1 + change[0], projection.w2 + change[1],
                          projection.height + change[2]);
    if (change.cwiseAbs().sum() < kLastProjectionStep) break;
  }
  return (point - projection.position).norm() < kMaxProjectionError &&
         projection.jacobian.determinant() > 0;
}

/// S_level of `levels` surfaces: S smoothed over a length that grows geometrically from the mean
/// edge length to √(free area).
Positions intermediate(const BoundSurface& bound, int level, int levels) {
  const double edge = whole_mean_edge_length(bound);
  double area = 0;
  for (int v : bound.region.free) area += bound.operators.masses[v];
  const double growth = std::max(std::sqrt(area) / edge, 1.0);
  return smoothed_surface(bound.mesh.positions, bound.even_operators(), bound.region,
                          edge * std::pow(growth, double(level) / levels));
}

}  // namespace

NormalDisplacement::NormalDisplacement(const BoundSurface& bound)
    : bound_(bound),
      triangles_(triangles_near_free(bound)),
      fans_(triangles_, bound.order().count()) {
  find_borders();
}

void NormalDisplacement::make_levels(int count) {
  levels_.clear();
  unrepresented_.clear();
  Rows fine = bound_.rest;
  for (int level = 1; level <= count; ++level) {
    const Rows coarse =
        in_order(level < count ? intermediate(bound_, level, count) : bound_.base, bound_.order());
    decompose(fine, coarse);
    fine = coarse;
  }
}

void NormalDisplacement::find_borders() {
  const Borders borders(triangles_, bound_.order().count());
  tangent_edges_.resize(static_cast<size_t>(bound_.order().count()));
  for (Index j = 0; j < triangles_.rows(); ++j)
    for (int k = 0; k < 3; ++k) {
      opposite_border_.push_back(borders.half_edges[3 * size_t(j) + size_t((k + 1) % 3)]);
      if (!opposite_border_.back()) continue;
      const int from = triangles_(j, (k + 1) % 3), to = triangles_(j, (k + 2) % 3);
      tangent_edges_[from].to = to;
      tangent_edges_[to].from = from;
    }
  for (Index k = 0; k < triangles_.size(); ++k) {
    // A row on no border takes the direction to any neighbour. An end that is missing, there and
    // where borders of a non-manifold mesh don't form loops, is the row itself.
    const int row = triangles_.data()[k];
    RowEdge& tangent = tangent_edges_[row];
    if (tangent.from < 0 && tangent.to < 0) tangent.to = triangles_(k / 3, (k + 1) % 3);
    if (tangent.from < 0) tangent.from = row;
    if (tangent.to < 0) tangent.to = row;
  }
}

void NormalDisplacement::compute_normals(const Rows& positions) {
  cross_products_.resize(triangles_.rows(), 4);
  vertex_normals_.resize(positions.rows(), 4);
  ThreadPool& pool = bound_.poisson->pool();
  pool.parallel_for(triangles_.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (Index j = begin; j < end; ++j) {
      const Vector3d first = vector3(positions, triangles_(j, 0));
      cross_products_.row(j) << (vector3(positions, triangles_(j, 1)) - first)
                                    .cross(vector3(positions, triangles_(j, 2)) - first)
                                    .transpose(),
          0;
    }
  });
  pool.parallel_for(positions.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (Index r = begin; r < end; ++r) {
      Eigen::RowVector4d sum = Eigen::RowVector4d::Zero();
      for (int j : fans_.of(static_cast<int>(r))) sum += cross_products_.row(j);
      const double length = sum.norm();
      vertex_normals_.row(r) =
          length > kMinSummedCross ? Eigen::RowVector4d(sum / length) : Eigen::RowVector4d::Zero();
    }
  });
}

Eigen::Matrix3d NormalDisplacement::frame_at(const Carrier& carrier,
                                             const Displacement& displacement) const {
  Vector3d normal = Vector3d::Zero(), tangent = Vector3d::Zero();
  for (int k = 0; k < 3; ++k) {
    const RowEdge& along = tangent_edges_[displacement.corner[k]];
    normal += displacement.weight[k] * vector3(carrier.normals, displacement.corner[k]);
    const Vector3d edge =
        vector3(carrier.positions, along.to) - vector3(carrier.positions, along.from);
    if (edge.norm() > kMinDirection) tangent += displacement.weight[k] * edge.normalized();
  }
  Eigen::Matrix3d frame = Eigen::Matrix3d::Identity();
  if (normal.norm() < kMinDirection) return frame;
  frame.col(2) = normal.normalized();
  tangent -= frame.col(2) * frame.col(2).dot(tangent);
  // The tangents of a triangle's corners may cancel. Offsets along the normal don't depend on the
  // tangent, so any direction serves.
  frame.col(0) = tangent.norm() > kMinDirection ? Vector3d(tangent.normalized())
                                                : Vector3d(frame.col(2).unitOrthogonal());
  frame.col(1) = frame.col(2).cross(frame.col(0));
  return frame;
}

Eigen::Vector3d NormalDisplacement::displaced(const Carrier& carrier,
                                              const Displacement& displacement) const {
  Vector3d position = Vector3d::Zero(), normal = Vector3d::Zero();
  for (int k = 0; k < 3; ++k) {
    position += displacement.weight[k] * vector3(carrier.positions, displacement.corner[k]);
    normal += displacement.weight[k] * vector3(carrier.normals, displacement.corner[k]);
  }
  if (!displacement.along_normal)
    return position + frame_at(carrier, displacement) * displacement.offset;
  const double length = normal.norm();
  return length > kMinDividedNormal ? Vector3d(position + displacement.offset[2] / length * normal)
                                    : position;
}

bool NormalDisplacement::project_onto_triangle(const Vector3d& point, int triangle,
                                               const Carrier& carrier, Displacement& found) const {
  const auto corner = triangles_.row(triangle);
  const NormalPrism prism = {
      vector3(carrier.positions, corner[0]), vector3(carrier.positions, corner[1]),
      vector3(carrier.positions, corner[2]), vector3(carrier.normals, corner[0]),
      vector3(carrier.normals, corner[1]),   vector3(carrier.normals, corner[2])};
  Projection projection;
  if (!find_projection(prism, point, projection)) return false;
  const double weight[3] = {1 - projection.w1 - projection.w2, projection.w1, projection.w2};
  if (!(weight[0] >= -kBarycentricTolerance && weight[1] >= -kBarycentricTolerance &&
        weight[2] >= -kBarycentricTolerance))
    return false;
  found.along_normal = true;
  for (int k = 0; k < 3; ++k) {
    found.corner[k] = corner[k];
    found.weight[k] = weight[k];
  }
  found.offset = {0, 0, projection.height};
  return true;
}

void NormalDisplacement::project_onto_border(const Vector3d& point, int triangle, int k,
                                             const Carrier& carrier, BorderProjection& closest,
                                             Displacement& found) const {
  const auto corner = triangles_.row(triangle);
  const int from = corner[(k + 1) % 3], to = corner[(k + 2) % 3];
  const Vector3d start = vector3(carrier.positions, from);
  const Vector3d edge = vector3(carrier.positions, to) - start, arm = point - start;
  const double along = edge.squaredNorm() > 0 ? arm.dot(edge) / edge.squaredNorm() : 0;
  const double clamped = std::clamp(along, 0.0, 1.0);
  const double distance = (arm - clamped * edge).norm();
  const Vector3d inwards = vector3(carrier.positions, corner[k]) - start - clamped * edge;
  if (distance >= closest.distance) return;
  closest.distance = distance;
  closest.is_beyond = (arm - clamped * edge).dot(inwards) <= 0;
  found.along_normal = false;
  found.corner[0] = from, found.corner[1] = found.corner[2] = to;
  found.weight[0] = 1 - clamped, found.weight[1] = clamped, found.weight[2] = 0;
}

bool NormalDisplacement::project(const Vector3d& point, int row, const Carrier& carrier,
                                 Displacement& found) {
  // Best-first search from the row's own triangles, by distance of the triangles' centroids from
  // the point, for the first prism that contains the point.
  std::priority_queue<std::pair<double, int>, std::vector<std::pair<double, int>>, std::greater<>>
      queue;
  const auto add_fan = [&](int corner) {
    for (int j : fans_.of(corner)) {
      if (last_visited_for_[j] == row) continue;
      last_visited_for_[j] = row;
      const auto corners = triangles_.row(j);
      const Vector3d centre =
          (vector3(carrier.positions, corners[0]) + vector3(carrier.positions, corners[1]) +
           vector3(carrier.positions, corners[2])) /
          3;
      queue.emplace((centre - point).squaredNorm(), j);
    }
  };
  add_fan(row);
  BorderProjection closest;
  for (int visited = 0; visited < kMaxVisitedTriangles && !queue.empty(); ++visited) {
    const int triangle = queue.top().second;
    queue.pop();
    if (project_onto_triangle(point, triangle, carrier, found)) return true;
    for (int k = 0; k < 3; ++k) {
      add_fan(triangles_(triangle, k));
      if (opposite_border_[3 * size_t(triangle) + size_t(k)])
        project_onto_border(point, triangle, k, carrier, closest, found);
    }
  }
  return closest.is_beyond;
}

bool NormalDisplacement::folds(const Carrier& carrier, const Level& level, int triangle) const {
  Vector3d projection[3], normal = Vector3d::Zero();
  for (int k = 0; k < 3; ++k) {
    const int r = triangles_(triangle, k);
    if (r >= bound_.order().free_count) {
      projection[k] = vector3(carrier.positions, r);
      normal += vector3(carrier.normals, r);
      continue;
    }
    if (!level[r].along_normal) return false;  // beyond the border, or failed already
    projection[k].setZero();
    for (int c = 0; c < 3; ++c) {
      projection[k] += level[r].weight[c] * vector3(carrier.positions, level[r].corner[c]);
      normal += level[r].weight[c] * vector3(carrier.normals, level[r].corner[c]);
    }
  }
  return (projection[1] - projection[0]).cross(projection[2] - projection[0]).dot(normal) < 0;
}

void NormalDisplacement::decompose(const Rows& fine, const Rows& coarse) {
  const int free_count = bound_.order().free_count;
  compute_normals(coarse);
  const Carrier onto = {coarse, vertex_normals_};
  last_visited_for_.assign(static_cast<size_t>(triangles_.rows()), -1);
  std::vector<char> failed(static_cast<size_t>(free_count), 0);
  Level level(static_cast<size_t>(free_count));
  for (int r = 0; r < free_count; ++r) {
    Displacement& displacement = level[r];
    if (!project(vector3(fine, r), r, onto, displacement)) {
      failed[r] = 1;
      displacement = {{r, r, r}, {1, 0, 0}, Vector3d::Zero(), false};
    }
    if (displacement.along_normal) continue;
    Vector3d projection = Vector3d::Zero();
    for (int k = 0; k < 3; ++k)
      projection += displacement.weight[k] * vector3(coarse, displacement.corner[k]);
    displacement.offset =
        frame_at(onto, displacement).transpose() * (vector3(fine, r) - projection);
  }
  for (int j = 0; j < static_cast<int>(triangles_.rows()); ++j) {
    if (!folds(onto, level, j)) continue;
    for (int k = 0; k < 3; ++k)
      if (triangles_(j, k) < free_count) failed[triangles_(j, k)] = 1;
  }
  for (int r = 0; r < free_count; ++r)
    if (failed[r]) unrepresented_.push_back(bound_.order().vertex_of_row[r]);
  levels_.push_back(std::move(level));
}

void NormalDisplacement::update(const Frame& frame, const MethodOptions& options) {
  // levels_ is incomplete if an earlier make_levels() threw.
  if (static_cast<int>(levels_.size()) != options.levels) make_levels(options.levels);
  const int free_count = bound_.order().free_count, held = bound_.order().count() - free_count;
  fine_ = frame.base;
  for (auto level = levels_.rbegin(); level != levels_.rend(); ++level) {
    coarse_ = fine_;
    compute_normals(coarse_);
    bound_.poisson->pool().parallel_for(free_count, kLeastRange, [&](int64_t begin, int64_t end) {
      const Carrier onto = {coarse_, vertex_normals_};
      for (Index r = begin; r < end; ++r)
        fine_.row(r).head<3>() = displaced(onto, (*level)[size_t(r)]).transpose();
    });
    // Constrained vertices lie on S in all levels, but not on a base from outside: they are set
    // anew.
    fine_.bottomRows(held) = bound_.rest.bottomRows(held) + frame.offsets.bottomRows(held);
  }
  frame.offsets.topRows(free_count) = fine_.topRows(free_count) - bound_.rest.topRows(free_count);
}

MethodFindings NormalDisplacement::findings() const {
  MethodFindings findings;
  findings.unrepresented = unrepresented_;
  return findings;
}

double NormalDisplacement::bytes() const {
  const auto doubles =
      cross_products_.size() + vertex_normals_.size() + fine_.size() + coarse_.size();
  double sum = static_cast<double>(triangles_.size()) * sizeof(int) + fans_.bytes() +
               static_cast<double>(doubles) * sizeof(double);
  for (const Level& level : levels_)
    sum += static_cast<double>(level.size() * sizeof(Displacement));
  return sum;
}

}  // namespace dd
