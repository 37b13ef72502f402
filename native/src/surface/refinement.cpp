// SPDX-License-Identifier: GPL-3.0-or-later
#include "surface/refinement.h"

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "mesh/topology.h"
#include "mesh/unit_box.h"
#include "surface/gradients.h"

namespace dd {

namespace {

constexpr int kLeastRange = 512;  // items that are worth a task

/// As the kernels take them.
template <class Value>
const Value (*rows_of(const std::vector<std::array<Value, kLanes>>& blocks))[kLanes] {
  return reinterpret_cast<const Value(*)[kLanes]>(blocks.data());
}

template <class Real>
class RefinementOf : public Refinement {
 public:
  explicit RefinementOf(FactoredSurface& surface);
  void run(int iterations, Rows& offsets) override;
  double bytes() const override;

 private:
  /// For each vertex the rows whose rotations it averages, kLanes vertices a block: what one of
  /// them has less than the others has no weight.
  struct Averages {
    std::vector<int> starts{0};
    std::vector<std::array<int32_t, kLanes>> index;
    std::vector<std::array<Real, kLanes>> weights;
    int count() const { return static_cast<int>(starts.size()) - 1; }
    double bytes() const {
      return static_cast<double>(starts.size() * sizeof(int) +
                                 index.size() * kLanes * (sizeof(int32_t) + sizeof(Real)));
    }
  };
  /// The terms of kLanes averages that are being collected.
  using Terms = std::array<std::vector<std::pair<int, double>>, kLanes>;
  using Quaternions = std::vector<Real>;  // rows of 4
  static constexpr int kPasses = 6;

  void make_averages(const std::vector<int>& vertices, const std::vector<int>& local_vertex,
                     const std::vector<int>& local_triangle, int first_rim);
  static void append(Averages& averages, Terms& terms);
  void make_turns(const std::vector<int>& local_vertex);
  int first_held_row() const { return kLanes * of_neighbours_.count(); }
  void apply(const Averages& averages, const Quaternions& in, Quaternions& out) const;
  /// Of the triangles without a free corner, which only the handles move.
  void find_held_rotations();
  /// Smoothed, of what positions_ shows.
  void find_vertex_rotations();
  /// As PoissonSystem::solve() takes it.
  void add(int section, double* rows) const;

  FactoredSurface& surface_;
  // Triangles are numbered anew: those with a free corner, padded to whole blocks, then those
  // without that share a vertex with them.
  std::vector<RotationBlock<Real>> moving_, held_;
  ActiveBlocks layout_;
  std::vector<TurnBlock<Real>> turns_;
  // For each vertex, of the rotations of its triangles; of those of vertices, and of the triangles
  // without a free corner.
  Averages of_triangles_, of_neighbours_;
  Quaternions triangle_rotations_, vertex_rotations_, smoothed_;
  Rows positions_, at_rest_;
};

template <class Real>
RefinementOf<Real>::RefinementOf(FactoredSurface& surface)
    : surface_(surface), layout_(surface.poisson->active()) {
  const Triangles& t = surface.mesh.triangles;
  const RowOrder& order = surface.order();
  const std::vector<int>& active = surface.poisson->active().triangles;
  const int m = surface.mesh.triangle_count();

  // Vertices of triangles with a free corner, and the other triangles of these vertices.
  std::vector<int> local_vertex(surface.region.role.size(), -1), vertices;
  std::vector<int> local_triangle(static_cast<size_t>(m), -1), rim;
  for (int j : active)
    for (int k = 0; k < 3; ++k) {
      int& number = local_vertex[t(j, k)];
      if (number >= 0) continue;
      number = static_cast<int>(vertices.size());
      vertices.push_back(t(j, k));
    }
  const StandIns standing =
      stand_ins(surface.mesh.positions, t, bounding_box_diagonal(surface.mesh.positions));
  moving_ = rotation_blocks<Real>(surface.mesh.positions, t, active, standing, order);
  const int first_rim = kLanes * static_cast<int>(moving_.size());
  for (size_t i = 0; i < active.size(); ++i) local_triangle[active[i]] = static_cast<int>(i);
  for (int j = 0; j < m; ++j) {
    if (local_triangle[j] >= 0) continue;
    for (int k = 0; k < 3; ++k) {
      if (local_vertex[t(j, k)] < 0) continue;
      local_triangle[j] = first_rim + static_cast<int>(rim.size());
      rim.push_back(j);
      break;
    }
  }
  if (!rim.empty()) held_ = rotation_blocks<Real>(surface.mesh.positions, t, rim, standing, order);

  make_averages(vertices, local_vertex, local_triangle, first_rim);
  make_turns(local_vertex);
  triangle_rotations_.assign(4 * (static_cast<size_t>(first_rim) + kLanes * held_.size()), 0);
  // The rotations of the triangles without a free corner stand behind those of the vertices.
  vertex_rotations_.assign(4 * (static_cast<size_t>(first_held_row()) + kLanes * held_.size()), 0);
  for (size_t i = 3; i < vertex_rotations_.size(); i += 4) vertex_rotations_[i] = 1;
  smoothed_ = vertex_rotations_;

  positions_ = surface.rest;
  find_held_rotations();
  find_vertex_rotations();
  at_rest_ = Rows::Zero(surface.poisson->right_hand_side_rows(), 4);
  for (int section = 0; section < layout_.sections(); ++section) add(section, at_rest_.data());
}

template <class Real>
void RefinementOf<Real>::make_averages(const std::vector<int>& vertices,
                                       const std::vector<int>& local_vertex,
                                       const std::vector<int>& local_triangle, int first_rim) {
  const Triangles& t = surface_.mesh.triangles;
  const Fans fans(t, surface_.mesh.vertex_count());

  const int blocks = (static_cast<int>(vertices.size()) + kLanes - 1) / kLanes;
  std::vector<double> share(vertices.size(), 0.0);  // of each neighbour of one vertex
  std::vector<int> neighbours;
  for (int b = 0; b < blocks; ++b) {
    Terms triangle_terms, vertex_terms;
    for (size_t lane = 0; lane < kLanes; ++lane) {
      const size_t vertex = static_cast<size_t>(b) * kLanes + lane;
      if (vertex >= vertices.size()) continue;
      const Fans::Range fan = fans.of(vertices[vertex]);
      double sum = 0;
      for (int j : fan) sum += surface_.operators.metric.areas[j];
      neighbours.clear();
      for (int j : fan) {
        const double weight = surface_.operators.metric.areas[j] / sum;
        triangle_terms[lane].emplace_back(local_triangle[j], weight);
        if (local_triangle[j] >= first_rim) {
          vertex_terms[lane].emplace_back(kLanes * blocks + local_triangle[j] - first_rim, weight);
          continue;
        }
        for (int k = 0; k < 3; ++k) {
          const int v = local_vertex[t(j, k)];
          if (share[v] == 0) neighbours.push_back(v);
          share[v] += weight / 3;
        }
      }
      for (int v : neighbours) vertex_terms[lane].emplace_back(v, std::exchange(share[v], 0.0));
    }
    append(of_triangles_, triangle_terms);
    append(of_neighbours_, vertex_terms);
  }
}

template <class Real>
void RefinementOf<Real>::append(Averages& averages, Terms& terms) {
  size_t longest = 1;
  for (auto& list : terms) {
    if (list.empty()) list.emplace_back(0, 1.0);  // a lane that nobody reads
    longest = std::max(longest, list.size());
  }
  for (size_t k = 0; k < longest; ++k) {
    averages.index.emplace_back();
    averages.weights.emplace_back();
    for (size_t lane = 0; lane < kLanes; ++lane) {
      const auto& list = terms[lane];
      averages.index.back()[lane] = list[std::min(k, list.size() - 1)].first;
      averages.weights.back()[lane] = k < list.size() ? static_cast<Real>(list[k].second) : Real(0);
    }
  }
  averages.starts.push_back(static_cast<int>(averages.index.size()));
}

template <class Real>
void RefinementOf<Real>::make_turns(const std::vector<int>& local_vertex) {
  const Triangles& t = surface_.mesh.triangles;
  const PoissonSystem& poisson = *surface_.poisson;
  const Positions flux = corner_divergence(surface_.operators.metric, surface_.mesh.positions, t);
  turns_ = layout_.without_targets<TurnBlock<Real>>(poisson);
  layout_.each(poisson.active(), [&](int i, int section, int b, int lane) {
    TurnBlock<Real>& block = turns_[b];
    const int j = poisson.active().triangles[i];
    for (int k = 0; k < 3; ++k) {
      block.corner[k][lane] = local_vertex[t(j, k)];
      block.target[k][lane] = poisson.target(section, t(j, k));
    }
    for (int k = 0; k < 2; ++k)
      for (int c = 0; c < 3; ++c)
        block.flux[k][c][lane] = static_cast<Real>(flux(3 * Index(j) + k, c));
  });
}

template <class Real>
void RefinementOf<Real>::apply(const Averages& averages, const Quaternions& in,
                               Quaternions& out) const {
  surface_.poisson->pool().parallel_for(
      averages.count(), kLeastRange / kLanes, [&](int64_t begin, int64_t end) {
        kernels().of<Real>().mean_rotations(static_cast<int>(begin), static_cast<int>(end),
                                            averages.starts.data(), rows_of(averages.index),
                                            rows_of(averages.weights), in.data(), out.data());
      });
}

template <class Real>
void RefinementOf<Real>::find_held_rotations() {
  Real* held = triangle_rotations_.data() + 4 * kLanes * moving_.size();
  kernels().of<Real>().rotation_pass(static_cast<int>(held_.size()), held_.data(),
                                     positions_.data(), held);
  const size_t count = 4 * kLanes * held_.size();
  for (Quaternions* rotations : {&vertex_rotations_, &smoothed_})
    std::copy_n(held, count, rotations->end() - static_cast<std::ptrdiff_t>(count));
}

template <class Real>
void RefinementOf<Real>::find_vertex_rotations() {
  surface_.poisson->pool().parallel_for(
      static_cast<int64_t>(moving_.size()), kLeastRange / kLanes, [&](int64_t begin, int64_t end) {
        kernels().of<Real>().rotation_pass(static_cast<int>(end - begin), moving_.data() + begin,
                                           positions_.data(),
                                           triangle_rotations_.data() + 4 * kLanes * begin);
      });
  apply(of_triangles_, triangle_rotations_, vertex_rotations_);
  for (int pass = 1; pass < kPasses; ++pass) {
    apply(of_neighbours_, vertex_rotations_, smoothed_);
    vertex_rotations_.swap(smoothed_);
  }
}

template <class Real>
void RefinementOf<Real>::add(int section, double* rows) const {
  const int begin = layout_.begin[section];
  kernels().of<Real>().turn_pass(layout_.begin[section + 1] - begin, turns_.data() + begin,
                                 vertex_rotations_.data(), rows);
}

template <class Real>
void RefinementOf<Real>::run(int iterations, Rows& offsets) {
  const RowOrder& order = surface_.order();
  for (int iteration = 0; iteration < iterations; ++iteration) {
    const int moved = iteration == 0 ? order.fixed_begin : order.free_count;
    surface_.poisson->pool().parallel_for(moved, kLeastRange, [&](int64_t begin, int64_t end) {
      const int64_t count = end - begin;
      positions_.middleRows(begin, count) =
          surface_.rest.middleRows(begin, count) + offsets.middleRows(begin, count);
    });
    if (iteration == 0) find_held_rotations();
    find_vertex_rotations();
    surface_.poisson->solve(
        at_rest_, [&](int section, double* rows) { add(section, rows); }, offsets);
  }
}

template <class Real>
double RefinementOf<Real>::bytes() const {
  const auto numbers = triangle_rotations_.size() + vertex_rotations_.size() + smoothed_.size();
  return static_cast<double>((moving_.size() + held_.size()) * sizeof(RotationBlock<Real>) +
                             turns_.size() * sizeof(TurnBlock<Real>) + numbers * sizeof(Real)) +
         of_triangles_.bytes() + of_neighbours_.bytes() +
         static_cast<double>((positions_.size() + at_rest_.size()) * Index(sizeof(double)));
}

}  // namespace

std::unique_ptr<Refinement> make_refinement(FactoredSurface& surface) {
  if (surface.poisson->precision() == Precision::single)
    return std::make_unique<RefinementOf<float>>(surface);
  return std::make_unique<RefinementOf<double>>(surface);
}

}  // namespace dd
