// SPDX-License-Identifier: GPL-3.0-or-later
#include "reconstruction/refinement.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <utility>
#include <vector>

#include "mesh/topology.h"
#include "mesh/unit_box.h"
#include "reconstruction/gradients.h"
#include "reconstruction/rotation_means.h"
#include "reconstruction/turn_pass.h"

namespace dd {

namespace {

struct Pass {
  double relaxation;  // factor ω of over-relaxation
  double smoothing;   // share of the rotation smoothing, 0 to 1
};

/// Over-relaxation, because long waves converge slowly. It multiplies short waves, which smoothing
/// takes out of the solution, by 1 − ω: (1 − 3.25) (1 − 1.45) ≈ 1, 1 − 2 = −1, and a pass with
/// ω = 1 ends them. Larger factors let the inside of a sharp bend buckle on dense meshes.
///
/// Smoothing keeps the surface from folding, but the first of four passes goes without, at half the
/// cost. Tuned on 108 poses of public meshes: 8,695 intersecting pairs, against 8,628 with all four
/// smoothed and 8,969 with two. After more passes the remaining stretch is due to smoothing, so the
/// last two have less of it.
Pass pass(int iteration, int iterations) {
  const int left = iterations - 1 - iteration;
  const bool beyond = left % 2 == 1;
  if (iterations <= 4) return {left == 0 ? 1 : beyond ? 3.25 : 1.45, left < 3 ? 1.0 : 0.0};
  return {iteration == 0 ? 4.0 : beyond ? 2.0 : 1.0, left == 0 ? 0.5 : left == 1 ? 0.8 : 1};
}

template <class Real>
class RefinementOf : public Refinement {
 public:
  RefinementOf(FactoredSurface& surface, double length, const Eigen::VectorXd& masses);
  void find(int iterations, const Turning& turning, Rows& offsets) override {
    posed_rotations_.clear();
    iterate(iterations, turning, offsets);
  }
  void find_from(const Rows& posed, int iterations, Rows& offsets) override;
  Rows rotations() const override;
  void add(int section, double* rows) const override {
    const TurnPass<Real>& pass = posed_rotations_.empty() ? pass_ : *posed_pass_;
    pass.add(vertex_rotations_.data(), section, rows);
  }
  const Rows& at_rest() const override { return *at_rest_; }
  double bytes() const override;

 private:
  using Quaternions = std::vector<Real>;  // rows of 4

  void make_averages(const std::vector<int>& local_triangle, int first_held);
  void iterate(int iterations, const Turning& turning, Rows& offsets);
  /// The row of an active vertex in vertex_rotations_: free ones in order, then rims.
  int rotation_row(int vertex) const;
  /// Rotations of the triangles without a free corner that have a rim vertex: only handles move
  /// them.
  void find_held_rotations();
  void find_moving_rotations();
  /// Vertex rotations from positions_: means over triangles, with the signs of gauge; null: with
  /// w >= 0.
  void find_means(const Rows* gauge);
  /// Makes the signs of neighbouring means agree along spanning trees of the surface, and keeps
  /// them in followed_ as gauge.
  void follow_means();
  /// The right-hand side at rest with this share of the smoothing, from the rotations found there,
  /// which differ from I by rounding.
  const Rows& at_rest_with(double smoothing);

  FactoredSurface& surface_;
  RotationSmoothing smoothing_;
  // Local triangle numbers: the active triangles, padded to whole blocks, then triangles without a
  // free corner at rims.
  std::vector<RotationBlock<Real>> moving_, held_;
  TurnPass<Real> pass_;
  RotationMeans<Real> averages_;  // of each active vertex
  Quaternions triangle_rotations_, vertex_rotations_;
  Quaternions from_pose_;
  Quaternions posed_rotations_;  // of triangles, from S to the pose; empty: none
  std::unique_ptr<TurnPass<Real>> posed_pass_;
  Rows positions_;
  Rows rest_given_, rest_smoothed_, rest_between_;
  const Rows* at_rest_ = nullptr;  // one of these three
  // of the spanning trees: between rows of vertex_rotations_
  std::vector<std::pair<int, int>> steps_;
  Rows followed_;
};

template <class Real>
RefinementOf<Real>::RefinementOf(FactoredSurface& surface, double length,
                                 const Eigen::VectorXd& masses)
    : surface_(surface),
      smoothing_(surface, length, masses),
      pass_(surface, surface.mesh.positions, [&](int v) { return rotation_row(v); }) {
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
  triangle_rotations_.assign(4 * (static_cast<size_t>(first_held) + kLanes * held_.size()), 0);
  vertex_rotations_.assign(4 * averages_.size(), 0);

  positions_ = surface.rest;
  find_held_rotations();
  find_means(nullptr);
  rest_given_ = pass_.all(vertex_rotations_.data());
  smoothing_.run(vertex_rotations_.data());
  rest_smoothed_ = pass_.all(vertex_rotations_.data());
}

template <class Real>
int RefinementOf<Real>::rotation_row(int vertex) const {
  return surface_.poisson->active_place(surface_.order().row_of_vertex[vertex]);
}

template <class Real>
void RefinementOf<Real>::make_averages(const std::vector<int>& local_triangle, int first_held) {
  const Fans fans(surface_.operators.triangles, surface_.mesh.vertex_count());
  const PoissonSystem& poisson = *surface_.poisson;
  typename RotationMeans<Real>::Terms terms;
  for (int i = 0; i < poisson.active_vertex_count(); ++i) {
    const Fans::Range fan = fans.of(poisson.active_vertex(i));
    const auto is_held = [&](int j) { return local_triangle[j] >= first_held; };
    const bool only_held = std::any_of(fan.begin(), fan.end(), is_held);
    double sum = 0;
    for (int j : fan)
      if (is_held(j) == only_held) sum += surface_.operators.metric.areas[j];
    terms.clear();
    for (int j : fan)
      if (is_held(j) == only_held)
        terms.emplace_back(local_triangle[j], surface_.operators.metric.areas[j] / sum);
    averages_.append(terms);
  }
  averages_.close();
}

template <class Real>
void RefinementOf<Real>::find_held_rotations() {
  kernels().of<Real>().rotation_pass(static_cast<int>(held_.size()), held_.data(),
                                     positions_.data(),
                                     triangle_rotations_.data() + 4 * kLanes * moving_.size());
}

template <class Real>
void RefinementOf<Real>::find_moving_rotations() {
  surface_.poisson->pool().parallel_for(
      static_cast<int64_t>(moving_.size()), kLeastRange / kLanes, [&](int64_t begin, int64_t end) {
        kernels().of<Real>().rotation_pass(static_cast<int>(end - begin), moving_.data() + begin,
                                           positions_.data(),
                                           triangle_rotations_.data() + 4 * kLanes * begin);
      });
}

template <class Real>
void RefinementOf<Real>::find_means(const Rows* gauge) {
  ThreadPool& pool = surface_.poisson->pool();
  find_moving_rotations();
  if (posed_rotations_.empty()) {
    averages_.run(triangle_rotations_, vertex_rotations_, pool);
  } else {
    from_pose_.resize(triangle_rotations_.size());
    pool.parallel_for(static_cast<int64_t>(triangle_rotations_.size() / 4), kLeastRange,
                      [&](int64_t begin, int64_t end) {
                        for (int64_t j = begin; j < end; ++j) {
                          using Quaternion = Eigen::Quaternion<Real>;
                          const Eigen::Map<const Quaternion> now(&triangle_rotations_[4 * j]),
                              posed(&posed_rotations_[4 * j]);
                          Eigen::Map<Quaternion> way(&from_pose_[4 * j]);
                          way = now * posed.conjugate();
                        }
                      });
    averages_.run(from_pose_, vertex_rotations_, pool);
  }
  // q and −q are one rotation, but smoothing needs neighbours with like signs.
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
const Rows& RefinementOf<Real>::at_rest_with(double smoothing) {
  if (smoothing == 0) return rest_given_;
  if (smoothing == 1) return rest_smoothed_;
  rest_between_ = (1 - smoothing) * rest_given_ + smoothing * rest_smoothed_;
  return rest_between_;
}

template <class Real>
void RefinementOf<Real>::find_from(const Rows& posed, int iterations, Rows& offsets) {
  positions_ = surface_.rest + posed;
  find_held_rotations();
  find_moving_rotations();
  posed_rotations_ = triangle_rotations_;
  if (!posed_pass_) posed_pass_ = std::make_unique<TurnPass<Real>>(pass_);
  posed_pass_->take(positions_);
  Turning turning;
  turning.unknown = true;
  iterate(iterations, turning, offsets);
}

template <class Real>
void RefinementOf<Real>::iterate(int iterations, const Turning& turning, Rows& offsets) {
  const RowOrder& order = surface_.order();
  PoissonSystem& poisson = *surface_.poisson;
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
    at_rest_ = &at_rest_with(how.smoothing);
    if (iteration < iterations - 1)
      poisson.solve(
          *at_rest_, [&](int section, double* rows) { add(section, rows); }, offsets,
          turning.share * how.relaxation);
  }
}

template <class Real>
Rows RefinementOf<Real>::rotations() const {
  return Eigen::Map<const Eigen::Matrix<Real, Eigen::Dynamic, 4, Eigen::RowMajor>>(
             vertex_rotations_.data(), surface_.poisson->active_vertex_count(), 4)
      .template cast<double>();
}

template <class Real>
double RefinementOf<Real>::bytes() const {
  const auto numbers = triangle_rotations_.size() + vertex_rotations_.size() + from_pose_.size() +
                       posed_rotations_.size();
  return smoothing_.bytes() +
         static_cast<double>((moving_.size() + held_.size()) * sizeof(RotationBlock<Real>) +
                             numbers * sizeof(Real) + steps_.size() * sizeof(steps_[0])) +
         averages_.bytes() + pass_.bytes() + (posed_pass_ ? posed_pass_->bytes() : 0) +
         static_cast<double>((positions_.size() + rest_given_.size() + rest_smoothed_.size() +
                              rest_between_.size() + followed_.size()) *
                             Index(sizeof(double)));
}

}  // namespace

double last_smoothing(int iterations) { return pass(iterations - 1, iterations).smoothing; }

std::unique_ptr<Refinement> make_refinement(FactoredSurface& surface, double length,
                                            const Eigen::VectorXd& masses) {
  if (surface.poisson->precision() == Precision::single)
    return std::make_unique<RefinementOf<float>>(surface, length, masses);
  return std::make_unique<RefinementOf<double>>(surface, length, masses);
}

}  // namespace dd
