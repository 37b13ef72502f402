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
constexpr double kFarFromProxy = 0.1;
// Multiple of an edge of S: if the closest points of its ends lie farther apart, they are reported
// as on different parts of the proxy. Above 1, as closest points legitimately spread over the
// outside of a bend of the proxy. Only the report depends on it.
constexpr double kTorn = 6;

}  // namespace

BaseProxy::BaseProxy(Mesh proxy)
    : rest_(std::move(proxy)),
      areas_(triangle_areas(rest_.positions, rest_.triangles)),
      stand_ins_(
          stand_ins(rest_.positions, rest_.triangles, bounding_box_diagonal(rest_.positions))) {
  for (Index j = 0; j < rest_.triangles.rows(); ++j) {
    const Eigen::Matrix3d at_rest = edges_and_normal(rest_.positions, rest_.triangles, j);
    inverse_.push_back(stand_ins_.of_triangle[size_t(j)] == j ? Eigen::Matrix3d(at_rest.inverse())
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
  bindings_.push_back({y.triangle, y.weights, y.place, x - y.place});
}

BaseProxy::BaseProxy(const Mesh& surface, Mesh proxy) : BaseProxy(std::move(proxy)) {
  const AabbTree tree(rest_);
  const double apart = kFarFromProxy * bounding_box_diagonal(rest_.positions);
  bindings_.reserve(size_t(surface.vertex_count()));
  for (int v = 0; v < surface.vertex_count(); ++v) {
    const Eigen::Vector3d x = surface.positions.row(v);
    bind(x, tree.nearest(x, std::numeric_limits<double>::infinity(), [](int) { return true; }));
    if (bindings_.back().arm.norm() > apart) far.push_back(v);
  }
  find_torn(surface);
}

void BaseProxy::find_borders() {
  std::vector<char> on_border(size_t(rest_.vertex_count()), 0);
  const Edges edges(rest_.triangles);
  for (int e = 0; e < edges.count(); ++e) {
    const auto around = edges.of(e);
    const auto sound =
        std::count_if(around.begin(), around.end(), [&](const Edges::HalfEdge& half) {
          return stand_ins_.of_triangle[size_t(half.triangle())] == half.triangle();
        });
    if (sound == 1) on_border[around.first->low] = on_border[around.first->high] = 1;
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

void BaseProxy::find_torn(const Mesh& surface) {
  std::vector<char> is_torn(bindings_.size(), 0);
  for (Index j = 0; j < surface.triangles.rows(); ++j)
    for (int k = 0; k < 3; ++k) {
      const int a = surface.triangles(j, k), b = surface.triangles(j, (k + 1) % 3);
      const double edge = (surface.positions.row(a) - surface.positions.row(b)).norm();
      const double apart = (bindings_[a].place - bindings_[b].place).norm();
      if (apart > kTorn * edge) is_torn[a] = is_torn[b] = 1;
    }
  for (size_t v = 0; v < is_torn.size(); ++v)
    if (is_torn[v]) torn.push_back(static_cast<int>(v));
}

std::vector<Eigen::Matrix3d> BaseProxy::corner_gradients(const Positions& deformed) const {
  // A triangle without area takes the gradient of its stand-in.
  std::vector<Eigen::Matrix3d> turns(size_t(rest_.vertex_count()), Eigen::Matrix3d::Zero());
  std::vector<double> weights(turns.size(), 0);
  for (Index j = 0; j < rest_.triangles.rows(); ++j) {
    const int by = stand_ins_.of_triangle[size_t(j)];
    if (by < 0) continue;
    const Eigen::Matrix3d F =
        edges_and_normal(deformed, rest_.triangles, by) * inverse_[size_t(by)];
    const double weight = std::max(areas_[j], 1e-30);
    for (int k = 0; k < 3; ++k) {
      turns[rest_.triangles(j, k)] += weight * F;
      weights[rest_.triangles(j, k)] += weight;
    }
  }
  for (size_t k = 0; k < turns.size(); ++k) {
    if (weights[k] > 0)
      turns[k] /= weights[k];
    else
      turns[k].setIdentity();
  }
  // The mean over a one-sided one-ring is the gradient half-way to the inner neighbours, so it is
  // extrapolated linearly to the border.
  for (const Border& border : borders_) {
    Eigen::Matrix3d inner = Eigen::Matrix3d::Zero();
    for (int k : border.inner) inner += turns[size_t(k)] / static_cast<double>(border.inner.size());
    turns[size_t(border.vertex)] = 2 * turns[size_t(border.vertex)] - inner;
  }
  return turns;
}

Positions BaseProxy::carry(const Positions& deformed, ThreadPool& pool) const {
  const std::vector<Eigen::Matrix3d> turns = corner_gradients(deformed);
  Positions result(Index(bindings_.size()), 3);
  pool.parallel_for(result.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (int64_t v = begin; v < end; ++v) {
      const Binding& binding = bindings_[size_t(v)];
      Eigen::Matrix3d F = Eigen::Matrix3d::Zero();
      Eigen::Vector3d place = Eigen::Vector3d::Zero();
      for (int k = 0; k < 3; ++k) {
        const int c = rest_.triangles(binding.triangle, k);
        const Eigen::Vector3d corner = rest_.positions.row(c), now = deformed.row(c);
        const double weight = binding.weights[k];
        F += weight * turns[size_t(c)];
        place += weight * (now + 0.5 * (turns[size_t(c)] * (binding.place - corner)));
      }
      result.row(v) = (place + F * binding.arm).transpose();
    }
  });
  return result;
}

double BaseProxy::bytes() const {
  return static_cast<double>(bindings_.size() * sizeof(Binding) +
                             inverse_.size() * sizeof(Eigen::Matrix3d)) +
         static_cast<double>(rest_.positions.size()) * sizeof(double) +
         static_cast<double>(rest_.triangles.size()) * sizeof(int);
}

}  // namespace dd
