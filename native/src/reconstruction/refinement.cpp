// SPDX-License-Identifier: GPL-3.0-or-later
#include "reconstruction/refinement.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <utility>
#include <vector>

#include "mesh/topology.h"
#include "mesh/triangles.h"
#include "mesh/unit_box.h"
#include "reconstruction/cross_section_means.h"
#include "reconstruction/fold_limits.h"
#include "reconstruction/gradients.h"
#include "reconstruction/limb_base.h"
#include "reconstruction/limb_bend.h"
#include "reconstruction/limb_twist.h"
#include "reconstruction/other_diagonals.h"
#include "reconstruction/rotated_flux_pass.h"
#include "reconstruction/rotation_means.h"

namespace dd {

namespace {

struct PassSettings {
  double relaxation;  // factor ω of over-relaxation
  double smoothing;   // fraction of the way to the smoothed rotations, 0 to 1
};

// Smoothing length of rotations of solid limbs, as a fraction of the arm. Tuned: with 0, relief
// decides the rotations, and long arms amplify them to folds; with 0.3, 36 poses of public meshes
// have 211 new intersecting pairs, with 0.6 124; with 1, limbs that are led aside lose volume.
constexpr double kSmoothingOfArm = 0.6;
// Rounds of averaging over sections in all iterations but the last. Tuned: with as many rounds as
// in the last one, 36 poses of public meshes had 73 new intersecting pairs in place of 57. With 1,
// a tentacle that is led down keeps 1% less of its sections; without any, the survey's cactus
// stretches by .18.
constexpr int kRoundsBetween = 2;

/// Long waves of the error converge slowly: a pass with factor ω moves them up to ω times as far.
/// It multiplies short waves, which smoothing takes out of the solution, by 1 − ω, so a pass with
/// ω = 1 ends them. The last pass always has ω = 1. The others, counted back from it:
/// - Of at most four passes in all, 3.25 and 1.45 in turn: (1 − 3.25) (1 − 1.45) ≈ 1 keeps short
///   waves as large as they are.
/// - More passes alternate 2, which only changes the sign of short waves, and 1. The first has 4 in
///   place of either: the error is largest there, and enough passes follow to end the short waves,
///   which it multiplies by −3.
///
/// Larger factors let the inside of a sharp bend buckle on dense meshes.
///
/// Smoothing keeps the surface from folding; the first of four passes does without, for half its
/// cost. Tuned on 108 poses of public meshes: 8,695 intersecting pairs, against 8,628 with all four
/// smoothed and 8,969 with two. After more than four passes the remaining stretch is due to
/// smoothing, so the last two have less of it.
PassSettings pass_settings(int iteration, int iterations) {
  const int remaining = iterations - 1 - iteration;
  const bool over_relaxed = remaining % 2 == 1;
  if (iterations <= 4)
    return {remaining == 0 ? 1 : over_relaxed ? 3.25 : 1.45, remaining < 3 ? 1.0 : 0.0};
  return {iteration == 0 ? 4.0
          : over_relaxed ? 2.0
                         : 1.0,
          remaining == 0   ? 0.5
          : remaining == 1 ? 0.8
                           : 1};
}

template <class Real>
class RefinementOf : public Refinement {
 public:
  RefinementOf(FactoredSurface& surface, const Positions* base, double length,
               const Eigen::VectorXd& masses, bool both_diagonals);
  void set_solidity(const CrossSections* sections, double solidity) override;
  const CrossSectionArms& arms() const override { return arms_; }
  const Eigen::VectorXd& solidity() const override { return solidity_of_row_; }
  void find(int iterations, const Rows& base, const Turning& turning, Rows& offsets) override {
    if (is_posed()) leave_pose();
    iterate(iterations, &base, turning, offsets);
  }
  void find_from(const Rows& posed, int iterations, Rows& offsets) override;
  Rows limb_base(const Rows& base, const Turning& turning) override;
  Rows rotations() const override;
  void add(int section, double* rows) const override {
    flux_pass().add(vertex_rotations_.data(), section, rows);
    limits_.add(vertex_rotations_.data(), arms_, section, rows);
  }
  const Rows& at_rest() const override { return *at_rest_; }
  double bytes() const override;

 private:
  using Quaternions = std::vector<Real>;  // rows of 4

  /// The triangles without a free corner that have a rim vertex.
  std::vector<int> constrained_triangles() const;
  /// The means of the vertices and what they are of, by both diagonals of quads or by the given
  /// one.
  void make_averages(bool both_diagonals);
  bool is_posed() const { return !posed_rotations_.empty(); }
  const RotatedFluxPass<Real>& flux_pass() const { return is_posed() ? *posed_pass_ : pass_; }
  void leave_pose() {
    posed_rotations_.clear();
    arms_.leave_pose();
    limits_.take(surface_.rest, arms_);
  }
  /// The rotations and right-hand sides at rest.
  void find_rest();
  /// The smoothing of rotations, over a longer length where arms are long.
  void make_smoothing(const Positions& arms);
  /// Turns the arms by the vertex rotations, after those of the pose.
  void turn_arms();
  /// One solve for free rows of offsets, over-relaxed by one factor where the surface is a skin and
  /// another one where it is solid. weight: of the solution in a skin.
  void step(double weight, double relaxation, double solid_relaxation, Rows& offsets);
  /// base: null: not known.
  void iterate(int iterations, const Rows* base, const Turning& turning, Rows& offsets);
  /// The row of an active vertex in vertex_rotations_: free ones in order, then rims.
  int rotation_row(int vertex) const;
  /// Rotations of the triangles without a free corner that have a rim vertex: only handles move
  /// them.
  void find_constrained_rotations();
  void find_moving_rotations();
  /// Vertex rotations from positions_: means over triangles, with the signs of gauge; null: with
  /// w >= 0.
  void find_means(const Rows* gauge);
  /// Makes the signs of neighbouring means agree along spanning trees of the surface, and keeps
  /// them in propagated_gauge_ as gauge.
  void propagate_signs();
  /// The right-hand side at rest with this fraction of the smoothing, from the rotations found
  /// there, which differ from I by rounding.
  const Rows& at_rest_with(double smoothing);

  FactoredSurface& surface_;
  const Positions* base_;  // B at rest, or null
  const bool both_diagonals_;
  double smoothing_length_;
  Eigen::VectorXd masses_;
  std::optional<RotationSmoothing> smoothing_;
  // By local number: the active triangles, padded to whole blocks, then those without a free corner
  // at rims.
  std::vector<RotationBlock<Real>> moving_, constrained_;
  std::vector<RotationBlock<Real>> others_;  // then those of OtherDiagonals, for solid limbs
  RotatedFluxPass<Real> pass_;
  RotationMeans<Real> averages_;  // of each active vertex
  Quaternions triangle_rotations_, vertex_rotations_;
  Quaternions from_pose_;
  Quaternions posed_rotations_;         // of triangles, from S to the pose; empty: none
  Quaternions posed_vertex_rotations_;  // the same of vertices, where there are sections
  std::unique_ptr<RotatedFluxPass<Real>> posed_pass_;
  const CrossSections* cross_sections_ = nullptr;
  double solidity_ = -1;                                          // below 0: not set
  std::unique_ptr<CrossSectionMeans<Real>> cross_section_means_;  // null: no sections
  std::unique_ptr<LimbTwist> limb_twist_;                         // of them
  std::unique_ptr<LimbBend> limb_bend_;                           // of them, if the base is known
  std::unique_ptr<LimbBase> limb_base_;                           // null: not needed so far
  CrossSectionArms arms_;
  FoldLimits<Real> limits_;
  Eigen::VectorXd solidity_of_row_;
  Rows positions_, before_;
  Rows rest_unsmoothed_, rest_smoothed_, rest_blended_;
  const Rows* at_rest_ = nullptr;  // one of these three
  // of the spanning trees: between rows of vertex_rotations_
  std::vector<std::pair<int, int>> tree_edges_;
  Rows propagated_gauge_;
};

template <class Real>
RefinementOf<Real>::RefinementOf(FactoredSurface& surface, const Positions* base, double length,
                                 const Eigen::VectorXd& masses, bool both_diagonals)
    : surface_(surface),
      base_(base),
      both_diagonals_(both_diagonals),
      smoothing_length_(length),
      masses_(masses),
      pass_(surface, surface.mesh.positions, [&](int v) { return rotation_row(v); }),
      arms_(surface),
      limits_(surface) {
  const Triangles& t = surface.operators.triangles;
  const StandIns stand_ins_of =
      stand_ins(surface.mesh.positions, t, bounding_box_diagonal(surface.mesh.positions));
  moving_ = rotation_blocks<Real>(surface.mesh.positions, t, surface.poisson->active().triangles,
                                  stand_ins_of, surface.order());
  if (const std::vector<int> constrained = constrained_triangles(); !constrained.empty())
    constrained_ = rotation_blocks<Real>(surface.mesh.positions, t, constrained, stand_ins_of,
                                         surface.order());
}

template <class Real>
std::vector<int> RefinementOf<Real>::constrained_triangles() const {
  const Triangles& t = surface_.operators.triangles;
  std::vector<char> is_rim(surface_.region.role.size(), 0), is_active(size_t(t.rows()), 0);
  for (int row : surface_.poisson->rims()) is_rim[surface_.order().vertex_of_row[row]] = 1;
  for (int j : surface_.poisson->active().triangles) is_active[j] = 1;
  std::vector<int> found;
  for (int j = 0; j < t.rows(); ++j)
    if (!is_active[j] && (is_rim[t(j, 0)] || is_rim[t(j, 1)] || is_rim[t(j, 2)]))
      found.push_back(j);
  return found;
}

template <class Real>
void RefinementOf<Real>::find_rest() {
  positions_ = surface_.rest;
  find_constrained_rotations();
  find_means(nullptr);
  rest_unsmoothed_ = pass_.all(vertex_rotations_.data());
  smoothing_->run(vertex_rotations_.data());
  rest_smoothed_ = pass_.all(vertex_rotations_.data());
}

template <class Real>
void RefinementOf<Real>::make_smoothing(const Positions& arms) {
  const double square = smoothing_length_ * smoothing_length_;
  Eigen::VectorXd masses = masses_;
  for (Index i = 0; i < arms.rows(); ++i)
    masses[surface_.poisson->active_vertex(int(i))] *=
        square / (square + kSmoothingOfArm * kSmoothingOfArm * arms.row(i).squaredNorm());
  smoothing_.emplace(surface_, smoothing_length_, masses);
}

template <class Real>
void RefinementOf<Real>::set_solidity(const CrossSections* sections, double solidity) {
  if (!sections || sections->empty() || solidity == 0) sections = nullptr, solidity = 0;
  if (sections == cross_sections_ && solidity == solidity_) return;
  cross_sections_ = nullptr;
  solidity_ = -1;  // not set if memory runs out
  if (sections)
    cross_section_means_ = std::make_unique<CrossSectionMeans<Real>>(surface_, *sections);
  limb_twist_.reset();
  limb_bend_.reset();
  limb_base_.reset();
  if (sections) limb_twist_ = std::make_unique<LimbTwist>(surface_, *sections, solidity);
  if (sections && base_)
    limb_bend_ = std::make_unique<LimbBend>(surface_, *sections, *base_, solidity);
  const Positions arms = sections ? Positions(solidity * sections->arms) : Positions(0, 3);
  make_smoothing(arms);
  const bool had_arms = !arms_.empty();
  const bool both = both_diagonals_ && sections;
  if (averages_.size() == 0 || both || !others_.empty()) make_averages(both);
  arms_.set(arms);
  solidity_of_row_.resize(0);
  if (sections) solidity_of_row_ = solidity * sections->shares.head(surface_.order().free_count);
  if (sections || had_arms) pass_.take(arms_.centres(surface_.rest));
  leave_pose();
  find_rest();
  cross_sections_ = sections;
  solidity_ = solidity;
}

template <class Real>
int RefinementOf<Real>::rotation_row(int vertex) const {
  return surface_.poisson->active_index(surface_.order().row_of_vertex[vertex]);
}

template <class Real>
void RefinementOf<Real>::make_averages(bool both_diagonals) {
  const PoissonSystem& poisson = *surface_.poisson;
  const Triangles& t = surface_.operators.triangles;
  const Positions& p = surface_.mesh.positions;
  const std::vector<int>& active = poisson.active().triangles;
  const int first_constrained = kLanes * static_cast<int>(moving_.size()),
            first_other = first_constrained + kLanes * static_cast<int>(constrained_.size());
  std::vector<int> local_triangle(size_t(t.rows()), -1);
  for (size_t i = 0; i < active.size(); ++i) local_triangle[active[i]] = static_cast<int>(i);
  const std::vector<int> constrained = constrained_triangles();
  for (size_t i = 0; i < constrained.size(); ++i)
    local_triangle[constrained[i]] = first_constrained + static_cast<int>(i);

  OtherDiagonals others{Triangles(0, 3), std::vector<int>(size_t(t.rows()), -1)};
  if (both_diagonals) others = other_diagonals(p, surface_.operators, active);
  std::vector<int> all(size_t(others.triangles.rows()));
  std::iota(all.begin(), all.end(), 0);
  const Eigen::VectorXd areas_of_others = triangle_areas(p, others.triangles);
  others_.clear();
  if (!all.empty())
    others_ = rotation_blocks<Real>(p, others.triangles, all,
                                    stand_ins(p, others.triangles, bounding_box_diagonal(p)),
                                    surface_.order());

  averages_ = {};
  const VertexTriangles fans(t, surface_.mesh.vertex_count());
  typename RotationMeans<Real>::Terms terms;
  for (int i = 0; i < poisson.active_vertex_count(); ++i) {
    const int vertex = poisson.active_vertex(i);
    const VertexTriangles::Range fan = fans.of(vertex);
    const auto is_constrained = [&](int j) { return local_triangle[j] >= first_constrained; };
    const bool only_constrained = std::any_of(fan.begin(), fan.end(), is_constrained);
    terms.clear();
    double sum = 0;
    const auto add = [&](int local, double weight) {
      terms.emplace_back(local, weight);
      sum += weight;
    };
    for (int j : fan) {
      if (is_constrained(j) != only_constrained) continue;
      const double area = surface_.operators.metric.areas[j];
      const int quad = others.quad_of[size_t(j)];
      add(local_triangle[j], quad < 0 ? area : 0.5 * area);
      if (quad < 0) continue;
      // A vertex is in one triangle of its quad and both of the other diagonal, or the reverse.
      const auto has_vertex = [&](int other) {
        return (others.triangles.row(other).array() == vertex).any();
      };
      const bool in_both = has_vertex(2 * quad) && has_vertex(2 * quad + 1);
      for (int other : {2 * quad, 2 * quad + 1})
        if (has_vertex(other))
          add(first_other + other, (in_both ? 0.5 : 0.25) * areas_of_others[other]);
    }
    for (auto& [local, weight] : terms) weight /= sum;
    averages_.append(terms);
  }
  averages_.close();
  triangle_rotations_.assign(4 * (size_t(first_other) + kLanes * others_.size()), 0);
  vertex_rotations_.assign(4 * averages_.size(), 0);
}

template <class Real>
void RefinementOf<Real>::find_constrained_rotations() {
  kernels().of<Real>().rotation_pass(static_cast<int>(constrained_.size()), constrained_.data(),
                                     positions_.data(),
                                     triangle_rotations_.data() + 4 * kLanes * moving_.size());
}

template <class Real>
void RefinementOf<Real>::find_moving_rotations() {
  const auto find = [&](const std::vector<RotationBlock<Real>>& blocks, Real* rotations) {
    surface_.poisson->pool().parallel_for(
        static_cast<int64_t>(blocks.size()), kLeastRange / kLanes, [&](int64_t begin, int64_t end) {
          kernels().of<Real>().rotation_pass(static_cast<int>(end - begin), blocks.data() + begin,
                                             positions_.data(), rotations + 4 * kLanes * begin);
        });
  };
  find(moving_, triangle_rotations_.data());
  find(others_, triangle_rotations_.data() + 4 * kLanes * (moving_.size() + constrained_.size()));
}

template <class Real>
void RefinementOf<Real>::find_means(const Rows* gauge) {
  ThreadPool& pool = surface_.poisson->pool();
  find_moving_rotations();
  if (!is_posed()) {
    averages_.run(triangle_rotations_, vertex_rotations_, pool);
  } else {
    from_pose_.resize(triangle_rotations_.size());
    pool.parallel_for(static_cast<int64_t>(triangle_rotations_.size() / 4), kLeastRange,
                      [&](int64_t begin, int64_t end) {
                        for (int64_t j = begin; j < end; ++j) {
                          using Quaternion = Eigen::Quaternion<Real>;
                          const Eigen::Map<const Quaternion> now(&triangle_rotations_[4 * j]),
                              posed(&posed_rotations_[4 * j]);
                          Eigen::Map<Quaternion> turn(&from_pose_[4 * j]);
                          turn = now * posed.conjugate();
                        }
                      });
    averages_.run(from_pose_, vertex_rotations_, pool);
  }
  // q and −q are one rotation, but smoothing needs neighbours with like signs.
  const PoissonSystem& poisson = *surface_.poisson;
  pool.parallel_for(poisson.active_vertex_count(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      Eigen::Map<Eigen::Matrix<Real, 4, 1>> q(vertex_rotations_.data() + 4 * i);
      const double agreement =
          gauge ? gauge->row(poisson.active_row(int(i))).dot(q.template cast<double>())
                : double(q[3]);
      if (agreement < 0) q = -q;
    }
  });
}

template <class Real>
void RefinementOf<Real>::propagate_signs() {
  const PoissonSystem& poisson = *surface_.poisson;
  const Triangles& t = surface_.operators.triangles;
  const int count = poisson.active_vertex_count();
  if (tree_edges_.empty()) {
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
            tree_edges_.emplace_back(front[i], next);
            front.push_back(next);
          }
    }
  }
  const auto mean = [&](int row) {
    return Eigen::Map<Eigen::Matrix<Real, 4, 1>>(vertex_rotations_.data() + 4 * Index(row));
  };
  for (const auto& [from, to] : tree_edges_)
    if (mean(from).dot(mean(to)) < 0) mean(to) *= Real(-1);
  propagated_gauge_ = Rows::Zero(poisson.order().count(), 4);
  for (int i = 0; i < count; ++i)
    propagated_gauge_.row(poisson.active_row(i)) = mean(i).transpose().template cast<double>();
}

template <class Real>
const Rows& RefinementOf<Real>::at_rest_with(double smoothing) {
  if (smoothing == 0) return rest_unsmoothed_;
  if (smoothing == 1) return rest_smoothed_;
  rest_blended_ = (1 - smoothing) * rest_unsmoothed_ + smoothing * rest_smoothed_;
  return rest_blended_;
}

template <class Real>
void RefinementOf<Real>::find_from(const Rows& posed, int iterations, Rows& offsets) {
  positions_ = surface_.rest + posed;
  find_constrained_rotations();
  find_moving_rotations();
  posed_rotations_ = triangle_rotations_;
  if (cross_sections_) {
    posed_vertex_rotations_.resize(vertex_rotations_.size());
    averages_.run(posed_rotations_, posed_vertex_rotations_, surface_.poisson->pool());
    arms_.turn(posed_vertex_rotations_.data());
    arms_.take_pose();
    limits_.take(positions_, arms_);
  }
  if (!posed_pass_) posed_pass_ = std::make_unique<RotatedFluxPass<Real>>(pass_);
  posed_pass_->take(arms_.centres(positions_));
  Turning turning;
  turning.propagate_signs = true;
  iterate(iterations, nullptr, turning, offsets);
}

template <class Real>
void RefinementOf<Real>::iterate(int iterations, const Rows* base, const Turning& given,
                                 Rows& offsets) {
  const RowOrder& order = surface_.order();
  PoissonSystem& poisson = *surface_.poisson;
  Turning turning = given;
  const bool even_twist = cross_sections_ && given.handles;
  if (even_twist) {
    limb_twist_->take(*given.handles);
    if (given.gauge) turning.gauge = &limb_twist_->even();
  }
  if (cross_sections_) cross_section_means_->take_gauge(turning);
  const bool bends = even_twist && limb_bend_ && base;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    const bool first = iteration == 0, last = iteration == iterations - 1;
    const int changed_rows = first ? order.fixed_begin : order.free_count;
    poisson.pool().parallel_for(changed_rows, kLeastRange, [&](int64_t begin, int64_t end) {
      const int64_t count = end - begin;
      positions_.middleRows(begin, count) =
          surface_.rest.middleRows(begin, count) + offsets.middleRows(begin, count);
    });
    if (first) find_constrained_rotations();
    find_means(turning.propagate_signs && !first ? &propagated_gauge_ : turning.gauge);
    if (turning.propagate_signs && first) propagate_signs();
    PassSettings settings = pass_settings(iteration, iterations);
    // Of stiff parts, smoothing makes one rotation.
    if (cross_sections_ || surface_.stiffness.varies()) settings.smoothing = 1;
    if (cross_sections_) {
      if (bends && first) limb_bend_->run(*base, limb_twist_->even(), vertex_rotations_);
      if (even_twist && (last || (first && given.gauge_weight > 0)))
        limb_twist_->run(vertex_rotations_, last ? 1 : given.gauge_weight);
      cross_section_means_->run(solidity_, last ? kCrossSectionRounds : kRoundsBetween,
                                vertex_rotations_);
    }
    if (settings.smoothing > 0) smoothing_->run(vertex_rotations_.data(), settings.smoothing);
    at_rest_ = &at_rest_with(settings.smoothing);
    turn_arms();
    // Over-relaxed from what a thread's triangles say, limbs would fold.
    const double solid_relaxation = bends && !first ? settings.relaxation : 1;
    if (!last) step(turning.refinement_weight, settings.relaxation, solid_relaxation, offsets);
  }
}

template <class Real>
void RefinementOf<Real>::turn_arms() {
  if (!cross_sections_) return;
  if (!is_posed()) return arms_.turn(vertex_rotations_.data());
  using Quaternion = Eigen::Quaternion<Real>;
  from_pose_ = vertex_rotations_;
  for (size_t i = 0; i < from_pose_.size(); i += 4) {
    Eigen::Map<Quaternion> q(&from_pose_[i]);
    q = q * Eigen::Map<const Quaternion>(&posed_vertex_rotations_[i]);
  }
  arms_.turn(from_pose_.data());
}

template <class Real>
void RefinementOf<Real>::step(double weight, double relaxation, double solid_relaxation,
                              Rows& offsets) {
  const auto add_flux = [&](int section, double* rows) {  // limits_ for the last solve alone
    flux_pass().add(vertex_rotations_.data(), section, rows);
  };
  const auto solve = [&](double factor) {
    surface_.poisson->solve(*at_rest_, add_flux, offsets, factor);
  };
  if (!cross_sections_) return solve(weight * relaxation);
  if (weight == 1 && relaxation == solid_relaxation) {
    arms_.solve_for_centres(offsets, [&] { solve(relaxation); });
    return;
  }
  const Index count = surface_.order().free_count;
  before_ = offsets.topRows(count);
  arms_.solve_anew_for_centres(offsets, [&] { solve(1); });
  surface_.poisson->pool().parallel_for(count, kLeastRange, [&](int64_t begin, int64_t end) {
    for (int64_t r = begin; r < end; ++r) {
      const double solid = solidity_of_row_[r];
      const double factor =
          (weight + solid * (1 - weight)) * (relaxation + solid * (solid_relaxation - relaxation));
      offsets.row(r) = before_.row(r) + factor * (offsets.row(r) - before_.row(r));
    }
  });
}

template <class Real>
Rows RefinementOf<Real>::limb_base(const Rows& base, const Turning& turning) {
  if (!limb_bend_ || !turning.handles) return Rows(0, 4);
  if (!limb_base_)
    limb_base_ = std::make_unique<LimbBase>(surface_, *cross_sections_, *base_, solidity_);
  limb_twist_->take(*turning.handles);
  return limb_base_->offsets(*limb_bend_, base, limb_twist_->even());
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
                       posed_rotations_.size() + posed_vertex_rotations_.size();
  return (smoothing_ ? smoothing_->bytes() : 0) + arms_.bytes() + limits_.bytes() +
         (cross_section_means_ ? cross_section_means_->bytes() : 0) +
         (limb_twist_ ? limb_twist_->bytes() : 0) + (limb_bend_ ? limb_bend_->bytes() : 0) +
         (limb_base_ ? limb_base_->bytes() : 0) +
         static_cast<double>((moving_.size() + constrained_.size() + others_.size()) *
                                 sizeof(RotationBlock<Real>) +
                             numbers * sizeof(Real) + tree_edges_.size() * sizeof(tree_edges_[0])) +
         averages_.bytes() + pass_.bytes() + (posed_pass_ ? posed_pass_->bytes() : 0) +
         static_cast<double>((positions_.size() + before_.size() + rest_unsmoothed_.size() +
                              rest_smoothed_.size() + rest_blended_.size() +
                              propagated_gauge_.size()) *
                             Index(sizeof(double)));
}

}  // namespace

double last_smoothing(int iterations) {
  return pass_settings(iterations - 1, iterations).smoothing;
}

std::unique_ptr<Refinement> make_refinement(FactoredSurface& surface, const Positions* base,
                                            double length, const Eigen::VectorXd& masses,
                                            bool both_diagonals) {
  if (surface.poisson->precision() == Precision::single)
    return std::make_unique<RefinementOf<float>>(surface, base, length, masses, both_diagonals);
  return std::make_unique<RefinementOf<double>>(surface, base, length, masses, both_diagonals);
}

}  // namespace dd
