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

namespace dd {

namespace {

using Eigen::Vector3d;

Vector3d vector(const Rows& rows, int row) { return rows.row(row).head<3>(); }

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

/// The point b + h n(b) over a triangle: barycentric weights w₁, w₂ of b (w₀ = 1 − w₁ − w₂), height
/// h.
struct Foot {
  double w1, w2, height;
  Vector3d normal;
  Eigen::Matrix3d jacobian;  // of place by w₁, w₂ and h
  Vector3d place;
};

/// A triangle of the carrier with vertex normals: the points b + h n(b) over it.
struct Prism {
  Vector3d q0, q1, q2, n0, n1, n2;

  Foot at(double w1, double w2, double height) const {
    Foot foot;
    foot.w1 = w1, foot.w2 = w2, foot.height = height;
    const Vector3d n = n0 + w1 * (n1 - n0) + w2 * (n2 - n0);
    const double length = n.norm();
    foot.normal = n / length;
    const auto turn = [&](const Vector3d& change) {
      return Vector3d((change - foot.normal * foot.normal.dot(change)) / length);
    };
    foot.jacobian.col(0) = q1 - q0 + height * turn(n1 - n0);
    foot.jacobian.col(1) = q2 - q0 + height * turn(n2 - n0);
    foot.jacobian.col(2) = foot.normal;
    foot.place = q0 + w1 * (q1 - q0) + w2 * (q2 - q0) + height * foot.normal;
    return foot;
  }
};

/// Finds the foot with the given place by Newton's method. False if it runs far out of the
/// triangle, doesn't converge, or converges beyond the centre of curvature, where the prism is
/// inverted.
bool find_foot(const Prism& prism, const Vector3d& point, Foot& foot) {
  constexpr double kFarthestFoot = 10;  // of |w₁| + |w₂|: the iteration has diverged
  const Vector3d e1 = prism.q1 - prism.q0, e2 = prism.q2 - prism.q0, cross = e1.cross(e2);
  const double squared = cross.squaredNorm();
  if (!(squared > 1e-60)) return false;
  const Vector3d arm = point - prism.q0;
  foot = prism.at(arm.cross(e2).dot(cross) / squared, e1.cross(arm).dot(cross) / squared,
                  arm.dot(cross) / std::sqrt(squared));
  for (int step = 0; step < 20; ++step) {
    if (!(std::abs(foot.w1) + std::abs(foot.w2) < kFarthestFoot)) return false;
    const Vector3d change = foot.jacobian.inverse() * (point - foot.place);
    if (!change.allFinite()) return false;
    foot = prism.at(foot.w1 + change[0], foot.w2 + change[1], foot.height + change[2]);
    if (change.cwiseAbs().sum() < 1e-14) break;
  }
  return (point - foot.place).norm() < 1e-12 && foot.jacobian.determinant() > 0;
}

/// S_level of `levels` surfaces: S smoothed over a length that grows geometrically from the mean
/// edge length to √(free area).
Positions intermediate(const BoundSurface& bound, int level, int levels) {
  const double edge = mean_edge_length(bound.mesh.positions, bound.mesh.triangles);
  double area = 0;
  for (int v : bound.region.free) area += bound.operators.masses[v];
  const double growth = std::max(std::sqrt(area) / edge, 1.0);
  return smoothed_surface(bound.mesh.positions, bound.operators, bound.region,
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
  tangent_.resize(static_cast<size_t>(bound_.order().count()));
  for (Index j = 0; j < triangles_.rows(); ++j)
    for (int k = 0; k < 3; ++k) {
      on_border_.push_back(borders.half_edges[3 * size_t(j) + size_t((k + 1) % 3)]);
      if (!on_border_.back()) continue;
      const int from = triangles_(j, (k + 1) % 3), to = triangles_(j, (k + 2) % 3);
      tangent_[from].to = to;
      tangent_[to].from = from;
    }
  for (Index k = 0; k < triangles_.size(); ++k) {
    // Away from borders any neighbour gives a direction. A missing end is the vertex itself.
    const int row = triangles_.data()[k];
    Edge& tangent = tangent_[row];
    if (tangent.from < 0 && tangent.to < 0) tangent.to = triangles_(k / 3, (k + 1) % 3);
    if (tangent.from < 0) tangent.from = row;
    if (tangent.to < 0) tangent.to = row;
  }
}

void NormalDisplacement::find_normals(const Rows& positions) {
  crosses_.resize(triangles_.rows(), 4);
  normals_.resize(positions.rows(), 4);
  ThreadPool& pool = bound_.poisson->pool();
  pool.parallel_for(triangles_.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (Index j = begin; j < end; ++j) {
      const Vector3d first = vector(positions, triangles_(j, 0));
      crosses_.row(j) << (vector(positions, triangles_(j, 1)) - first)
                             .cross(vector(positions, triangles_(j, 2)) - first)
                             .transpose(),
          0;
    }
  });
  pool.parallel_for(positions.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (Index r = begin; r < end; ++r) {
      Eigen::RowVector4d sum = Eigen::RowVector4d::Zero();
      for (int j : fans_.of(static_cast<int>(r))) sum += crosses_.row(j);
      // Twice an area in the unit box: less is rounding, and has no direction.
      const double length = sum.norm();
      normals_.row(r) =
          length > 1e-13 ? Eigen::RowVector4d(sum / length) : Eigen::RowVector4d::Zero();
    }
  });
}

Eigen::Matrix3d NormalDisplacement::frame_at(const Carrier& carrier,
                                             const Displacement& displacement) const {
  Vector3d normal = Vector3d::Zero(), tangent = Vector3d::Zero();
  for (int k = 0; k < 3; ++k) {
    const Edge& along = tangent_[displacement.corner[k]];
    normal += displacement.weight[k] * vector(carrier.normals, displacement.corner[k]);
    const Vector3d edge =
        vector(carrier.positions, along.to) - vector(carrier.positions, along.from);
    if (edge.norm() > 1e-9) tangent += displacement.weight[k] * edge.normalized();
  }
  Eigen::Matrix3d frame = Eigen::Matrix3d::Identity();
  if (normal.norm() < 1e-9) return frame;
  frame.col(2) = normal.normalized();
  tangent -= frame.col(2) * frame.col(2).dot(tangent);
  // Without a tangent any serves for offsets along the normal, which don't depend on it.
  frame.col(0) = tangent.norm() > 1e-9 ? Vector3d(tangent.normalized())
                                       : Vector3d(frame.col(2).unitOrthogonal());
  frame.col(1) = frame.col(2).cross(frame.col(0));
  return frame;
}

Eigen::Vector3d NormalDisplacement::displaced(const Carrier& carrier,
                                              const Displacement& displacement) const {
  Vector3d place = Vector3d::Zero(), normal = Vector3d::Zero();
  for (int k = 0; k < 3; ++k) {
    place += displacement.weight[k] * vector(carrier.positions, displacement.corner[k]);
    normal += displacement.weight[k] * vector(carrier.normals, displacement.corner[k]);
  }
  if (!displacement.along_normal)
    return place + frame_at(carrier, displacement) * displacement.offset;
  const double length = normal.norm();
  return length > 1e-150 ? Vector3d(place + displacement.offset[2] / length * normal) : place;
}

bool NormalDisplacement::project(const Vector3d& point, int row, const Carrier& carrier,
                                 Displacement& found) {
  constexpr int kMostTriangles = 400;  // limit on visited triangles: bounds the cost of a vertex
  // Tolerance of barycentric weights: without it rounding loses points over a shared edge.
  constexpr double kSlack = 1e-9;
  // Best-first search from the row's own triangles, by distance of the triangles' centroids from
  // the point, for the first prism that contains the point.
  std::priority_queue<std::pair<double, int>, std::vector<std::pair<double, int>>, std::greater<>>
      queue;
  const auto add_fan = [&](int corner) {
    for (int j : fans_.of(corner)) {
      if (seen_for_[j] == row) continue;
      seen_for_[j] = row;
      const auto corners = triangles_.row(j);
      const Vector3d centre =
          (vector(carrier.positions, corners[0]) + vector(carrier.positions, corners[1]) +
           vector(carrier.positions, corners[2])) /
          3;
      queue.emplace((centre - point).squaredNorm(), j);
    }
  };
  add_fan(row);
  double closest = std::numeric_limits<double>::infinity();
  bool over_border = false;
  for (int looked_at = 0; looked_at < kMostTriangles && !queue.empty(); ++looked_at) {
    const int triangle = queue.top().second;
    queue.pop();
    const auto corner = triangles_.row(triangle);
    const Prism prism = {vector(carrier.positions, corner[0]), vector(carrier.positions, corner[1]),
                         vector(carrier.positions, corner[2]), vector(carrier.normals, corner[0]),
                         vector(carrier.normals, corner[1]),   vector(carrier.normals, corner[2])};
    Foot foot;
    if (find_foot(prism, point, foot)) {
      const double weight[3] = {1 - foot.w1 - foot.w2, foot.w1, foot.w2};
      if (weight[0] >= -kSlack && weight[1] >= -kSlack && weight[2] >= -kSlack) {
        found.along_normal = true;
        for (int k = 0; k < 3; ++k) {
          found.corner[k] = corner[k];
          found.weight[k] = weight[k];
        }
        found.offset = {0, 0, foot.height};
        return true;
      }
    }
    for (int k = 0; k < 3; ++k) {
      add_fan(corner[k]);
      if (!on_border_[3 * size_t(triangle) + size_t(k)]) continue;
      const int from = corner[(k + 1) % 3], to = corner[(k + 2) % 3];
      const Vector3d start = vector(carrier.positions, from);
      const Vector3d edge = vector(carrier.positions, to) - start, arm = point - start;
      const double along = edge.squaredNorm() > 0 ? arm.dot(edge) / edge.squaredNorm() : 0;
      const double clamped = std::clamp(along, 0.0, 1.0);
      const double distance = (arm - clamped * edge).norm();
      const Vector3d inwards = vector(carrier.positions, corner[k]) - start - clamped * edge;
      // Of all border edges visited, the closest one decides; the point must lie on its outer side.
      if (distance >= closest) continue;
      closest = distance;
      over_border = (arm - clamped * edge).dot(inwards) <= 0;
      found.along_normal = false;
      found.corner[0] = from, found.corner[1] = found.corner[2] = to;
      found.weight[0] = 1 - clamped, found.weight[1] = clamped, found.weight[2] = 0;
    }
  }
  return over_border;
}

bool NormalDisplacement::folds(const Carrier& carrier, const Level& level, int triangle) const {
  Vector3d foot[3], normal = Vector3d::Zero();
  for (int k = 0; k < 3; ++k) {
    const int r = triangles_(triangle, k);
    if (r >= bound_.order().free_count) {
      foot[k] = vector(carrier.positions, r);
      normal += vector(carrier.normals, r);
      continue;
    }
    if (!level[r].along_normal) return false;  // beyond the border, or failed already
    foot[k].setZero();
    for (int c = 0; c < 3; ++c) {
      foot[k] += level[r].weight[c] * vector(carrier.positions, level[r].corner[c]);
      normal += level[r].weight[c] * vector(carrier.normals, level[r].corner[c]);
    }
  }
  return (foot[1] - foot[0]).cross(foot[2] - foot[0]).dot(normal) < 0;
}

void NormalDisplacement::decompose(const Rows& fine, const Rows& coarse) {
  const int free_count = bound_.order().free_count;
  find_normals(coarse);
  const Carrier onto = {coarse, normals_};
  seen_for_.assign(static_cast<size_t>(triangles_.rows()), -1);
  std::vector<char> failed(static_cast<size_t>(free_count), 0);
  Level level(static_cast<size_t>(free_count));
  for (int r = 0; r < free_count; ++r) {
    Displacement& displacement = level[r];
    if (!project(vector(fine, r), r, onto, displacement)) {
      failed[r] = 1;
      displacement = {{r, r, r}, {1, 0, 0}, Vector3d::Zero(), false};
    }
    if (displacement.along_normal) continue;
    Vector3d foot = Vector3d::Zero();
    for (int k = 0; k < 3; ++k)
      foot += displacement.weight[k] * vector(coarse, displacement.corner[k]);
    displacement.offset = frame_at(onto, displacement).transpose() * (vector(fine, r) - foot);
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
  surface_ = frame.base;
  for (auto level = levels_.rbegin(); level != levels_.rend(); ++level) {
    coarse_ = surface_;
    find_normals(coarse_);
    bound_.poisson->pool().parallel_for(free_count, kLeastRange, [&](int64_t begin, int64_t end) {
      const Carrier onto = {coarse_, normals_};
      for (Index r = begin; r < end; ++r)
        surface_.row(r).head<3>() = displaced(onto, (*level)[size_t(r)]).transpose();
    });
    // Constrained vertices lie on S in all levels, but not on a base from outside: they are set
    // anew.
    surface_.bottomRows(held) = bound_.rest.bottomRows(held) + frame.offsets.bottomRows(held);
  }
  frame.offsets.topRows(free_count) =
      surface_.topRows(free_count) - bound_.rest.topRows(free_count);
}

MethodFindings NormalDisplacement::findings() const {
  MethodFindings findings;
  findings.unrepresented = unrepresented_;
  return findings;
}

double NormalDisplacement::bytes() const {
  const auto doubles = crosses_.size() + normals_.size() + surface_.size() + coarse_.size();
  double sum = static_cast<double>(triangles_.size()) * sizeof(int) + fans_.bytes() +
               static_cast<double>(doubles) * sizeof(double);
  for (const Level& level : levels_)
    sum += static_cast<double>(level.size() * sizeof(Displacement));
  return sum;
}

}  // namespace dd
