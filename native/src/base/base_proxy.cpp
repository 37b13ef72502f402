// SPDX-License-Identifier: GPL-3.0-or-later
#include "base/base_proxy.h"

#include <Eigen/LU>
#include <algorithm>
#include <limits>
#include <utility>

#include "mesh/topology.h"
#include "mesh/triangles.h"
#include "mesh/unit_box.h"

namespace dd {

namespace {

// Fraction of the proxy's box diagonal. A vertex farther from the proxy is reported: its binding is
// a guess. Only the report depends on it.
constexpr double kFarDistance = 0.1;
// Multiple of an edge of S: if the closest points of its ends lie farther apart, they are reported
// as on different parts of the proxy. Above 1, as closest points legitimately spread over the
// outside of a bend of the proxy. Only the report depends on it.
constexpr double kAmbiguousSpread = 6;

}  // namespace

BaseProxy::BaseProxy(Mesh proxy)
    : rest_(std::move(proxy)),
      areas_(triangle_areas(rest_.positions, rest_.triangles)),
      stand_ins_(
          stand_ins(rest_.positions, rest_.triangles, bounding_box_diagonal(rest_.positions))) {
  for (Index j = 0; j < rest_.triangles.rows(); ++j) {
    const Eigen::Matrix3d at_rest = edges_and_normal(rest_.positions, rest_.triangles, j);
    rest_inverses_.push_back(stand_ins_.of_triangle[size_t(j)] == j
                                 ? Eigen::Matrix3d(at_rest.inverse())
                                 : Eigen::Matrix3d::Identity());
  }
  find_borders();
}

BaseProxy::BaseProxy(const Positions& points, const std::vector<PointOnTriangle>& nearest,
                     Mesh proxy)
    : BaseProxy(std::move(proxy)) {
  bindings_.reserve(nearest.size());
  for (size_t i = 0; i < nearest.size(); ++i) bind(points.row(Index(i)), nearest[i]);
}

void BaseProxy::bind(const Eigen::Vector3d& x, const PointOnTriangle& y) {
  bindings_.push_back({y.triangle, y.barycentric, y.position, x - y.position});
}

BaseProxy::BaseProxy(const Mesh& surface, Mesh proxy) : BaseProxy(std::move(proxy)) {
  const AabbTree tree(rest_);
  const double distance = kFarDistance * bounding_box_diagonal(rest_.positions);
  bindings_.reserve(size_t(surface.vertex_count()));
  for (int v = 0; v < surface.vertex_count(); ++v) {
    const Eigen::Vector3d x = surface.positions.row(v);
    bind(x, tree.nearest(x, std::numeric_limits<double>::infinity(), [](int) { return true; }));
    if (bindings_.back().arm.norm() > distance) far.push_back(v);
  }
  find_ambiguous(surface);
}

void BaseProxy::find_borders() {
  std::vector<char> on_border(size_t(rest_.vertex_count()), 0);
  const Edges edges(rest_.triangles);
  for (int e = 0; e < edges.count(); ++e) {
    const auto around = edges.of(e);
    const auto has_own_gradient =
        std::count_if(around.begin(), around.end(), [&](const Edges::HalfEdge& half) {
          return stand_ins_.of_triangle[size_t(half.triangle())] == half.triangle();
        });
    if (has_own_gradient == 1) on_border[around.first->low] = on_border[around.first->high] = 1;
  }
  std::vector<std::vector<int>> inner(on_border.size());
  for (int e = 0; e < edges.count(); ++e) {
    const int low = edges.of(e).first->low, high = edges.of(e).first->high;
    if (on_border[low] && !on_border[high]) inner[low].push_back(high);
    if (on_border[high] && !on_border[low]) inner[high].push_back(low);
  }
  for (size_t v = 0; v < inner.size(); ++v)
    if (!inner[v].empty()) borders_.push_back({static_cast<int>(v), std::move(inner[v])});
}

void BaseProxy::find_ambiguous(const Mesh& surface) {
  std::vector<char> is_ambiguous(bindings_.size(), 0);
  for (Index j = 0; j < surface.triangles.rows(); ++j)
    for (int k = 0; k < 3; ++k) {
      const int a = surface.triangles(j, k), b = surface.triangles(j, (k + 1) % 3);
      const double edge = (surface.positions.row(a) - surface.positions.row(b)).norm();
      const double distance = (bindings_[a].position - bindings_[b].position).norm();
      if (distance > kAmbiguousSpread * edge) is_ambiguous[a] = is_ambiguous[b] = 1;
    }
  for (size_t v = 0; v < is_ambiguous.size(); ++v)
    if (is_ambiguous[v]) ambiguous.push_back(static_cast<int>(v));
}

std::vector<Eigen::Matrix3d> BaseProxy::corner_gradients(const Positions& deformed) const {
  // A triangle without area takes the gradient of its stand-in.
  std::vector<Eigen::Matrix3d> gradients(size_t(rest_.vertex_count()), Eigen::Matrix3d::Zero());
  std::vector<double> weights(gradients.size(), 0);
  for (Index j = 0; j < rest_.triangles.rows(); ++j) {
    const int stand_in = stand_ins_.of_triangle[size_t(j)];
    if (stand_in < 0) continue;
    const Eigen::Matrix3d F =
        edges_and_normal(deformed, rest_.triangles, stand_in) * rest_inverses_[size_t(stand_in)];
    // Safety: a corner all of whose triangles are without area has the mean of their stand-ins.
    const double weight = std::max(areas_[j], 1e-30);
    for (int k = 0; k < 3; ++k) {
      gradients[rest_.triangles(j, k)] += weight * F;
      weights[rest_.triangles(j, k)] += weight;
    }
  }
  for (size_t k = 0; k < gradients.size(); ++k) {
    if (weights[k] > 0)
      gradients[k] /= weights[k];
    else
      gradients[k].setIdentity();
  }
  // The mean over a one-sided one-ring is the gradient half-way to the inner neighbours, so it is
  // extrapolated linearly to the border.
  for (const Border& border : borders_) {
    Eigen::Matrix3d inner = Eigen::Matrix3d::Zero();
    for (int k : border.inner)
      inner += gradients[size_t(k)] / static_cast<double>(border.inner.size());
    gradients[size_t(border.vertex)] = 2 * gradients[size_t(border.vertex)] - inner;
  }
  return gradients;
}

Positions BaseProxy::carry(const Positions& deformed, ThreadPool& pool) const {
  const std::vector<Eigen::Matrix3d> gradients = corner_gradients(deformed);
  Positions result(Index(bindings_.size()), 3);
  pool.parallel_for(result.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (int64_t v = begin; v < end; ++v) {
      const Binding& binding = bindings_[size_t(v)];
      Eigen::Matrix3d F = Eigen::Matrix3d::Zero();
      Eigen::Vector3d position = Eigen::Vector3d::Zero();
      for (int k = 0; k < 3; ++k) {
        const int c = rest_.triangles(binding.triangle, k);
        const Eigen::Vector3d corner = rest_.positions.row(c), deformed_corner = deformed.row(c);
        const double weight = binding.weights[k];
        F += weight * gradients[size_t(c)];
        position +=
            weight * (deformed_corner + 0.5 * (gradients[size_t(c)] * (binding.position - corner)));
      }
      result.row(v) = (position + F * binding.arm).transpose();
    }
  });
  return result;
}

double BaseProxy::bytes() const {
  return static_cast<double>(bindings_.size() * sizeof(Binding) +
                             rest_inverses_.size() * sizeof(Eigen::Matrix3d)) +
         static_cast<double>(rest_.positions.size()) * sizeof(double) +
         static_cast<double>(rest_.triangles.size()) * sizeof(int);
}

}  // namespace dd
