// SPDX-License-Identifier: GPL-3.0-or-later
#include "systems/operators.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "mesh/topology.h"
#include "systems/intrinsic_delaunay.h"

namespace dd {

namespace {

// Least height of a triangle as a fraction of its longest edge. Safety: entries of K grow with the
// inverse cube, see TriangleMetric.
constexpr double kMinHeightRatio = 1e-3;
// Length up to which three corners count as one point, in the mesh's units. Safety: keeps quotients
// of lengths out of the denormal range.
constexpr double kPointLength = std::numeric_limits<double>::min() * 1e20;

/// A triangle laid out in the plane: the longest edge from (0, 0) to (base, 0), the third corner
/// at (foot, height).
struct Layout {
  int apex, first, second;  // corner numbers, 0 to 2
  double base, foot, height;
  bool degenerate;
};

/// Three coincident corners define no shape. This arbitrary one has nearly equal sides, so that its
/// cotangents are of ordinary size, and is so small that it adds nothing to masses.
Layout in_one_place(const Layout& layout) {
  return {layout.apex, layout.first, layout.second, 1e-100, 0.5e-100, 0.8e-100, true};
}

void lift(Layout& layout) {
  layout.degenerate = layout.height < kMinHeightRatio * layout.base;
  if (layout.degenerate) layout.height = kMinHeightRatio * layout.base;
}

Layout lay_out(const Positions& p, const Triangles& t, Index j) {
  const Eigen::Vector3d x[3] = {p.row(t(j, 0)), p.row(t(j, 1)), p.row(t(j, 2))};
  Layout layout{};
  double longest = -1;
  for (int k = 0; k < 3; ++k) {
    const double length = (x[(k + 2) % 3] - x[(k + 1) % 3]).squaredNorm();
    if (length > longest) {
      longest = length;
      layout.apex = k;
    }
  }
  layout.first = (layout.apex + 1) % 3;
  layout.second = (layout.apex + 2) % 3;
  const Eigen::Vector3d edge = x[layout.second] - x[layout.first];
  const Eigen::Vector3d arm = x[layout.apex] - x[layout.first];
  layout.base = edge.norm();
  if (!(layout.base > kPointLength)) return in_one_place(layout);
  layout.foot = arm.dot(edge) / layout.base;
  layout.height = edge.cross(arm).norm() / layout.base;
  lift(layout);
  return layout;
}

/// The same for a triangle that is given by its edge lengths, each opposite to a corner.
Layout lay_out(const Eigen::RowVector3d& lengths) {
  Layout layout{};
  layout.base = lengths.maxCoeff(&layout.apex);
  layout.first = (layout.apex + 1) % 3;
  layout.second = (layout.apex + 2) % 3;
  if (!(layout.base > kPointLength)) return in_one_place(layout);
  const TriangleApex apex =
      triangle_apex(layout.base, lengths[layout.second], lengths[layout.first]);
  layout.foot = apex.foot;
  layout.height = apex.height;
  lift(layout);
  return layout;
}

void set_metric(TriangleMetric& metric, Index j, const Layout& l) {
  metric.areas[j] = 0.5 * l.base * l.height;
  const double rest = l.base - l.foot;
  metric.cotangents(j, l.first) = l.foot / l.height;
  metric.cotangents(j, l.second) = rest / l.height;
  metric.cotangents(j, l.apex) = l.height / l.base - (l.foot / l.height) * (rest / l.base);
}

/// Stable insertion sort of short arrays, for which std::stable_sort would allocate a buffer on
/// each call.
template <class Value, class Less>
void sort_stably(std::vector<Value>& values, const Less& less) {
  // Length up to which arrays are sorted by insertion; a vertex of degree d has 2 d entries.
  constexpr size_t kMaxInsertionSort = 32;
  if (values.size() > kMaxInsertionSort) {
    std::stable_sort(values.begin(), values.end(), less);
    return;
  }
  for (size_t i = 1; i < values.size(); ++i) {
    const Value value = values[i];
    size_t index = i;
    for (; index > 0 && less(value, values[index - 1]); --index) values[index] = values[index - 1];
    values[index] = value;
  }
}

}  // namespace

TriangleMetric triangle_metric(const Positions& p, const Triangles& t) {
  const Index m = t.rows();
  TriangleMetric metric;
  metric.cotangents.resize(m, 3);
  metric.areas.resize(m);
  for (Index j = 0; j < m; ++j) {
    const Layout l = lay_out(p, t, j);
    if (l.degenerate) metric.degenerate.push_back(static_cast<int>(j));
    set_metric(metric, j, l);
  }
  return metric;
}

SparseMatrix cotangent_laplacian(const TriangleMetric& metric, const Triangles& t, int n) {
  struct Entry {
    int row;
    double value;
  };
  constexpr auto by_row = [](const Entry& a, const Entry& b) { return a.row < b.row; };
  const VertexTriangles fans(t, n);
  SparseMatrix laplacian(n, n);
  laplacian.reserve(t.size() + 2 * Index{n});
  // off-diagonal entries of a column, in the order of the vertex's triangles
  std::vector<Entry> entries;
  for (int v = 0; v < n; ++v) {
    laplacian.startVec(v);
    entries.clear();
    int last = -1;
    for (int j : fans.of(v)) {
      if (std::exchange(last, j) == j) continue;  // a triangle lists v at several corners
      for (int k = 0; k < 3; ++k) {
        const int a = t(j, (k + 1) % 3), b = t(j, (k + 2) % 3);
        const double value = -0.5 * metric.cotangents(j, k);
        if (a == v) entries.push_back({b, value});
        if (b == v) entries.push_back({a, value});
      }
    }
    if (entries.empty()) continue;
    sort_stably(entries, by_row);
    double diagonal = 0;
    for (const Entry& entry : entries)
      if (entry.row != v) diagonal -= entry.value;
    bool has_diagonal = false;
    const auto add_diagonal = [&] {
      if (!std::exchange(has_diagonal, true)) laplacian.insertBackByOuterInner(v, v) = diagonal;
    };
    for (size_t i = 0; i < entries.size();) {
      const int row = entries[i].row;
      double sum = 0;
      for (; i < entries.size() && entries[i].row == row; ++i) sum += entries[i].value;
      if (row >= v) add_diagonal();
      if (row != v) laplacian.insertBackByOuterInner(v, row) = sum;
    }
    add_diagonal();
  }
  laplacian.finalize();
  return laplacian;
}

Eigen::VectorXd mixed_voronoi_masses(const TriangleMetric& metric, const Triangles& t, int n) {
  Eigen::VectorXd masses = Eigen::VectorXd::Zero(n);
  for (Index j = 0; j < t.rows(); ++j) {
    const double area = metric.areas[j];
    const auto cot = metric.cotangents.row(j);
    int obtuse = -1;
    for (int k = 0; k < 3; ++k)
      if (cot[k] < 0) obtuse = k;
    for (int k = 0; k < 3; ++k) {
      if (obtuse >= 0) {
        masses[t(j, k)] += area * (k == obtuse ? 0.5 : 0.25);
        continue;
      }
      // Voronoi part of corner k: (|ab|² cot γ + |ac|² cot β) / 8, with
      // |ab|² = 2 area (cot α + cot β).
      const double alpha = cot[k], beta = cot[(k + 1) % 3], gamma = cot[(k + 2) % 3];
      masses[t(j, k)] += 0.25 * area * ((alpha + beta) * gamma + (alpha + gamma) * beta);
    }
  }
  // Safety: the mass is divided by in K = L M⁻¹ L, and is 0 at vertices of triangles without area.
  const double floor = 1e-8 * masses.sum() / n;
  return masses.cwiseMax(floor);
}

SurfaceOperators surface_operators(const Positions& p, const Triangles& t,
                                   Triangulation triangulation) {
  const int n = static_cast<int>(p.rows());
  SurfaceOperators operators;
  operators.triangles = t;
  operators.metric = triangle_metric(p, t);
  // cot α + cot β of an edge is below kObtuse only if one of them is below half of it.
  if (triangulation == Triangulation::delaunay && t.size() > 0 &&
      operators.metric.cotangents.minCoeff() < 0.5 * kObtuse) {
    IntrinsicTriangles intrinsic = intrinsic_delaunay(p, t);
    operators.flipped = intrinsic.flips > 0;
    if (operators.flipped) {
      operators.triangles = std::move(intrinsic.triangles);
      for (Index j = 0; j < t.rows(); ++j)
        if (intrinsic.flipped[j])
          set_metric(operators.metric, j, lay_out(intrinsic.lengths.row(j)));
    }
  }
  operators.laplacian = cotangent_laplacian(operators.metric, operators.triangles, n);
  operators.masses = mixed_voronoi_masses(operators.metric, operators.triangles, n);
  return operators;
}

SurfaceOperators stiffened(const SurfaceOperators& even, const Stiffness& stiffness) {
  SurfaceOperators operators = even;
  operators.stiffness = stiffness.of_triangles(operators.triangles);
  operators.metric.cotangents.array().colwise() *= operators.stiffness.array();
  operators.laplacian = cotangent_laplacian(operators.metric, operators.triangles,
                                            static_cast<int>(operators.masses.size()));
  return operators;
}

SparseMatrix gradient(const Positions& p, const Triangles& t) {
  const Index m = t.rows();
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(static_cast<size_t>(m) * 9);
  for (Index j = 0; j < m; ++j) {
    const Layout l = lay_out(p, t, j);
    // Map the layout to space by a frame of the triangle's plane, or, for a collinear triangle, of
    // any plane through its line.
    const Eigen::Vector3d e = (p.row(t(j, l.second)) - p.row(t(j, l.first))).transpose();
    const Eigen::Vector3d arm = (p.row(t(j, l.apex)) - p.row(t(j, l.first))).transpose();
    const Eigen::Vector3d x =
        e.norm() > 0 ? Eigen::Vector3d(e.normalized()) : Eigen::Vector3d::UnitX();
    const Eigen::Vector3d off = arm - x * x.dot(arm);
    const Eigen::Vector3d y =
        off.norm() > 0 ? Eigen::Vector3d(off.normalized()) : Eigen::Vector3d(x.unitOrthogonal());
    std::array<Eigen::Vector3d, 3> grad;
    grad[l.apex] = y / l.height;
    grad[l.second] = x / l.base - y * (l.foot / (l.base * l.height));
    grad[l.first] = -grad[l.apex] - grad[l.second];
    for (int k = 0; k < 3; ++k)
      for (int c = 0; c < 3; ++c)
        entries.emplace_back(static_cast<int>(3 * j + c), t(j, k), grad[k][c]);
  }
  SparseMatrix G(3 * m, p.rows());
  G.setFromTriplets(entries.begin(), entries.end());
  return G;
}

SparseMatrix divergence(const SparseMatrix& gradient, const TriangleMetric& metric) {
  const Eigen::VectorXd weights = metric.areas.transpose().replicate(3, 1).reshaped();
  return gradient.transpose() * weights.asDiagonal();
}

Positions corner_divergence(const TriangleMetric& metric, const Positions& p, const Triangles& t) {
  Positions result(3 * t.rows(), 3);
  for (Index j = 0; j < t.rows(); ++j)
    result.middleRows<3>(3 * j) = corner_divergences(metric, p, t, j).transpose();
  return result;
}

double mean_edge_length(const Positions& p, const Triangles& t) {
  double sum = 0;
  for (Index j = 0; j < t.rows(); ++j) {
    for (int k = 0; k < 3; ++k) sum += (p.row(t(j, (k + 1) % 3)) - p.row(t(j, k))).norm();
  }
  return sum / static_cast<double>(3 * t.rows());
}

}  // namespace dd
