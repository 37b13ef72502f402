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

struct Pass {
  double relaxation;  // how many times the way to the next solution it goes
  double smoothing;   // how much of the smoothing it has
};

/// Long waves converge slowly, so some passes go beyond. Short ones, of which the smoothing leaves
/// nothing, grow by that, and the passes between end them. Going farther lets the inside of a sharp
/// bend buckle on dense meshes.
///
/// Smoothing is what keeps the surface from folding, and three passes of it do so wherever four do:
/// the first goes without, at half the cost. With two, meshes fold that didn't. After many passes
/// what is left of the stretch is the smoothing's own doing: the last two have less of it.
Pass pass(int iteration, int iterations) {
  const int left = iterations - 1 - iteration;
  const bool beyond = left % 2 == 1;
  if (iterations <= 4) return {left == 0 ? 1 : beyond ? 3.25 : 1.45, left < 3 ? 1.0 : 0.0};
  return {iteration == 0 ? 4.0 : beyond ? 2.0 : 1.0, left == 0 ? 0.5 : left == 1 ? 0.8 : 1};
}

/// As the kernels take them.
template <class Value>
const Value (*rows_of(const std::vector<std::array<Value, kLanes>>& blocks))[kLanes] {
  return reinterpret_cast<const Value(*)[kLanes]>(blocks.data());
}

template <class Real>
class RefinementOf : public Refinement {
 public:
  RefinementOf(FactoredSurface& surface, double length);
  double length() const override { return smoothing_.length(); }
  void run(int iterations, ClampedPoisson* clamped, const Turning& turning, Rows& offsets) override;
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

  void make_averages(const std::vector<int>& local_triangle, int first_held);
  static void append(Averages& averages, Terms& terms);
  /// The row of a vertex's rotation: free ones in order, then rims.
  int rotation_row(int vertex) const;
  /// Of the triangles without a free corner, which only the handles move.
  void find_held_rotations();
  /// Of what positions_ shows: means around each vertex, with the signs of the gauge.
  void find_means(const Rows* gauge);
  /// A gauge of the means: a walk over the surface, from vertex to neighbour.
  void follow_means();
  /// As PoissonSystem::solve() takes it.
  void add(int section, double* rows) const;
  /// The same of all sections.
  Rows turned() const;
  /// What the rotations at rest make, which rounding leaves beside none, with so much smoothing.
  const Rows& at_rest(double smoothing);

  FactoredSurface& surface_;
  RotationSmoothing smoothing_;
  // Triangles are numbered anew: those with a free corner, padded to whole blocks, then those
  // without that share a vertex with them.
  std::vector<RotationBlock<Real>> moving_, held_;
  ActiveBlocks layout_;
  std::vector<TurnBlock<Real>> turns_;
  Averages averages_;
  Quaternions triangle_rotations_, vertex_rotations_;
  Rows positions_, start_;
  Rows rest_given_, rest_smoothed_, rest_between_;
  std::vector<std::pair<int, int>> steps_;  // of the walk: from a row of rotations to another
  Rows followed_;
};

template <class Real>
RefinementOf<Real>::RefinementOf(FactoredSurface& surface, double length)
    : surface_(surface), smoothing_(surface, length), layout_(surface.poisson->active()) {
  const Triangles& t = surface.operators.triangles;
  const RowOrder& order = surface.order();
  const std::vector<int>& active = surface.poisson->active().triangles;
  const int m = surface.mesh.triangle_count();

  std::vector<char> is_rim(surface.region.role.size(), 0);
  for (int row : surface.poisson->rims()) is_rim[order.vertex_of_row[row]] = 1;
  const StandIns standing =
      stand_ins(surface.mesh.positions, t, bounding_box_diagonal(surface.mesh.positions));
  moving_ = rotation_blocks<Real>(surface.mesh.positions, t, active, standing, order);
  const int first_held = kLanes * static_cast<int>(moving_.size());
  std::vector<int> local_triangle(static_cast<size_t>(m), -1), held;
  for (size_t i = 0; i < active.size(); ++i) local_triangle[active[i]] = static_cast<int>(i);
  for (int j = 0; j < m; ++j) {
    if (local_triangle[j] >= 0) continue;
    for (int k = 0; k < 3; ++k) {
      if (!is_rim[t(j, k)]) continue;
      local_triangle[j] = first_held + static_cast<int>(held.size());
      held.push_back(j);
      break;
    }
  }
  if (!held.empty())
    held_ = rotation_blocks<Real>(surface.mesh.positions, t, held, standing, order);

  make_averages(local_triangle, first_held);
  turns_ = turn_blocks<Real>(surface, layout_, surface.mesh.positions,
                             [&](int v) { return rotation_row(v); });
  triangle_rotations_.assign(4 * (static_cast<size_t>(first_held) + kLanes * held_.size()), 0);
  vertex_rotations_.assign(4 * static_cast<size_t>(kLanes * averages_.count()), 0);

  positions_ = surface.rest;
  find_held_rotations();
  find_means(nullptr);
  rest_given_ = turned();
  smoothing_.run(vertex_rotations_.data());
  rest_smoothed_ = turned();
}

template <class Real>
int RefinementOf<Real>::rotation_row(int vertex) const {
  return surface_.poisson->active_place(surface_.order().row_of_vertex[vertex]);
}

template <class Real>
void RefinementOf<Real>::make_averages(const std::vector<int>& local_triangle, int first_held) {
  const Fans fans(surface_.operators.triangles, surface_.mesh.vertex_count());
  const PoissonSystem& poisson = *surface_.poisson;
  std::vector<int> vertices;
  vertices.reserve(static_cast<size_t>(poisson.active_vertex_count()));
  for (int i = 0; i < poisson.active_vertex_count(); ++i)
    vertices.push_back(poisson.order().vertex_of_row[poisson.active_row(i)]);

  const size_t blocks = (vertices.size() + kLanes - 1) / kLanes;
  Terms terms;
  for (size_t b = 0; b < blocks; ++b) {
    for (size_t lane = 0; lane < kLanes; ++lane) {
      terms[lane].clear();
      const size_t i = b * kLanes + lane;
      if (i >= vertices.size()) continue;
      const Fans::Range fan = fans.of(vertices[i]);
      const auto is_held = [&](int j) { return local_triangle[j] >= first_held; };
      const bool only_held = std::any_of(fan.begin(), fan.end(), is_held);
      double sum = 0;
      for (int j : fan)
        if (is_held(j) == only_held) sum += surface_.operators.metric.areas[j];
      for (int j : fan)
        if (is_held(j) == only_held)
          terms[lane].emplace_back(local_triangle[j], surface_.operators.metric.areas[j] / sum);
    }
    append(averages_, terms);
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
void RefinementOf<Real>::find_held_rotations() {
  kernels().of<Real>().rotation_pass(static_cast<int>(held_.size()), held_.data(),
                                     positions_.data(),
                                     triangle_rotations_.data() + 4 * kLanes * moving_.size());
}

template <class Real>
void RefinementOf<Real>::find_means(const Rows* gauge) {
  const auto& pass = kernels().of<Real>();
  ThreadPool& pool = surface_.poisson->pool();
  pool.parallel_for(
      static_cast<int64_t>(moving_.size()), kLeastRange / kLanes, [&](int64_t begin, int64_t end) {
        pass.rotation_pass(static_cast<int>(end - begin), moving_.data() + begin, positions_.data(),
                           triangle_rotations_.data() + 4 * kLanes * begin);
      });
  pool.parallel_for(averages_.count(), kLeastRange / kLanes, [&](int64_t begin, int64_t end) {
    pass.mean_rotations(static_cast<int>(begin), static_cast<int>(end), averages_.starts.data(),
                        rows_of(averages_.index), rows_of(averages_.weights),
                        triangle_rotations_.data(), vertex_rotations_.data());
  });
  // A rotation is two quaternions; the smoothing must not meet one of each side by side.
  const PoissonSystem& poisson = *surface_.poisson;
  pool.parallel_for(poisson.active_vertex_count(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      Eigen::Map<Eigen::Matrix<Real, 4, 1>> q(vertex_rotations_.data() + 4 * i);
      const double side =
          gauge ? gauge->row(poisson.active_row(int(i))).dot(q.template cast<double>())
                : double(q[3]);
      if (side < 0) q = -q;
    }
  });
}

template <class Real>
void RefinementOf<Real>::follow_means() {
  const PoissonSystem& poisson = *surface_.poisson;
  const Triangles& t = surface_.operators.triangles;
  const int count = poisson.active_vertex_count();
  if (steps_.empty()) {
    std::vector<std::vector<int>> neighbours(static_cast<size_t>(count));
    for (int j : poisson.active().triangles)
      for (int k = 0; k < 3; ++k)
        for (int other : {(k + 1) % 3, (k + 2) % 3})
          neighbours[rotation_row(t(j, k))].push_back(rotation_row(t(j, other)));
    std::vector<char> reached(static_cast<size_t>(count), 0);
    for (int start = 0; start < count; ++start) {
      if (reached[start]) continue;
      reached[start] = 1;
      std::vector<int> front{start};
      for (size_t i = 0; i < front.size(); ++i)
        for (int next : neighbours[front[i]])
          if (!std::exchange(reached[next], 1)) {
            steps_.emplace_back(front[i], next);
            front.push_back(next);
          }
    }
  }
  const auto mean = [&](int row) {
    return Eigen::Map<Eigen::Matrix<Real, 4, 1>>(vertex_rotations_.data() + 4 * Index(row));
  };
  for (const auto& [from, to] : steps_)
    if (mean(from).dot(mean(to)) < 0) mean(to) *= Real(-1);
  followed_ = Rows::Zero(poisson.order().count(), 4);
  for (int i = 0; i < count; ++i)
    followed_.row(poisson.active_row(i)) = mean(i).transpose().template cast<double>();
}

template <class Real>
void RefinementOf<Real>::add(int section, double* rows) const {
  const int begin = layout_.begin[section];
  kernels().of<Real>().turn_pass(layout_.begin[section + 1] - begin, turns_.data() + begin,
                                 vertex_rotations_.data(), rows);
}

template <class Real>
Rows RefinementOf<Real>::turned() const {
  Rows rows = Rows::Zero(surface_.poisson->right_hand_side_rows(), 4);
  for (int section = 0; section < layout_.sections(); ++section) add(section, rows.data());
  return rows;
}

template <class Real>
const Rows& RefinementOf<Real>::at_rest(double smoothing) {
  if (smoothing == 0) return rest_given_;
  if (smoothing == 1) return rest_smoothed_;
  rest_between_ = (1 - smoothing) * rest_given_ + smoothing * rest_smoothed_;
  return rest_between_;
}

template <class Real>
void RefinementOf<Real>::run(int iterations, ClampedPoisson* clamped, const Turning& turning,
                             Rows& offsets) {
  const RowOrder& order = surface_.order();
  PoissonSystem& poisson = *surface_.poisson;
  if (turning.share < 1) start_ = offsets;
  const auto add_turned = [&](int section, double* rows) { add(section, rows); };
  for (int iteration = 0; iteration < iterations; ++iteration) {
    const int moved = iteration == 0 ? order.fixed_begin : order.free_count;
    poisson.pool().parallel_for(moved, kLeastRange, [&](int64_t begin, int64_t end) {
      const int64_t count = end - begin;
      positions_.middleRows(begin, count) =
          surface_.rest.middleRows(begin, count) + offsets.middleRows(begin, count);
    });
    if (iteration == 0) find_held_rotations();
    find_means(turning.unknown && iteration > 0 ? &followed_ : turning.gauge);
    if (turning.unknown && iteration == 0) follow_means();
    const Pass how = pass(iteration, iterations);
    if (how.smoothing > 0) smoothing_.run(vertex_rotations_.data(), how.smoothing);
    if (clamped && iteration == iterations - 1)
      clamped->step(at_rest(how.smoothing), add_turned, offsets);
    else
      poisson.solve(at_rest(how.smoothing), add_turned, offsets, turning.share * how.relaxation);
  }
  if (turning.share < 1) offsets = start_ + turning.share * (offsets - start_);
}

template <class Real>
double RefinementOf<Real>::bytes() const {
  const auto numbers = triangle_rotations_.size() + vertex_rotations_.size();
  return smoothing_.bytes() +
         static_cast<double>((moving_.size() + held_.size()) * sizeof(RotationBlock<Real>) +
                             turns_.size() * sizeof(TurnBlock<Real>) + numbers * sizeof(Real) +
                             steps_.size() * sizeof(steps_[0])) +
         averages_.bytes() +
         static_cast<double>((positions_.size() + start_.size() + rest_given_.size() +
                              rest_smoothed_.size() + rest_between_.size() + followed_.size()) *
                             Index(sizeof(double)));
}

}  // namespace

std::unique_ptr<Refinement> make_refinement(FactoredSurface& surface, double length) {
  if (surface.poisson->precision() == Precision::single)
    return std::make_unique<RefinementOf<float>>(surface, length);
  return std::make_unique<RefinementOf<double>>(surface, length);
}

}  // namespace dd
