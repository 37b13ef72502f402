// SPDX-License-Identifier: GPL-3.0-or-later
#include "match/registration.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "match/fit_goals.h"
#include "match/triangle_match.h"
#include "mesh/measures.h"
#include "mesh/topology.h"
#include "mesh/triangles.h"
#include "mesh/unit_box.h"
#include "reconstruction/fourth_points.h"
#include "support/rotations.h"
#include "support/thread_pool.h"
#include "systems/free_block.h"
#include "systems/operators.h"
#include "systems/tets.h"

namespace dd {

namespace {

// The weight that holds a vertex where it is, as a fraction of its diagonal entry of the energy.
// Safety: the system of a component that nothing attracts would be singular.
constexpr double kAnchoringFraction = 1e-9;
// λ of the stages, from which w_C follows: a stage with a shorter one lets shorter deformations
// follow the closest points (registration.h). As fractions of the target box's diagonal:
constexpr double kFirstWave = 1;            // of the first stage
constexpr double kFirstWaveAfterMap = 0.5;  // of the first stage after one that followed the map
constexpr double kMapWave = 0.4;            // of the stage that follows the alignment's map
constexpr double kMinWaveBothWays = 0.1;    // longer ones use closest points of source and target
constexpr double kMinWaveTipsHeld = 0.1;    // longer ones hold paired tips of limbs in place
constexpr double kLastWaveEdges = 4;        // of the last stage, in mean edge lengths of the source
// The fit led by the map is taken if it stretches the source less than the other fit or, on shapes
// that lie on one another, less than this many times as much: there closest points leave posed
// limbs behind unstretched.
constexpr double kMaxStretchRatioOfGuided = 2;

/// What leads the first stage of a fit, before those by closest points.
enum class Lead { nothing, markers, tips, map };

/// The system over vertices and fourth points of the source, in the target's unit box.
class Registration {
 public:
  Registration(const Mesh& source, const Mesh& target, const Pairs& markers,
               const RegistrationOptions& options)
      : options_(options),
        pool_(options.threads),
        target_(target),
        finder_(source, target, options.reach, pool_),
        initial_mesh_(source),
        now_(source) {
    const std::vector<int> usable = usable_triangles(source);
    tets_ = with_fourth_points(source, usable);
    unknowns_ = tets_.positions;
    find_region(source.vertex_count(), markers);
    initial_unknowns_ = unknowns_;
    build_energy(source, usable);
    edge_length_ = mean_edge_length(source.positions, source.triangles);
  }

  /// Sets the goals of run_guided(). representatives: for each vertex, the one by whose
  /// displacement it is displaced. goals: where each of those goes, in the unit box.
  void set_guide(std::vector<int> representatives, Positions goals) {
    representatives_ = std::move(representatives);
    representative_goals_ = std::move(goals);
  }

  /// Sets vertices of the source that are held at vertices of the target while λ is long.
  void set_held_tips(Pairs tips) { held_tips_ = std::move(tips); }

  /// Resets all positions to those at the beginning.
  void reset() {
    unknowns_ = initial_unknowns_;
    now_.positions = initial_mesh_.positions;
  }

  /// A stage without closest points: only the markers and the held tips attract.
  void run_marked(const Progress& progress) {
    closeness_weights_.setZero(vertex_count_);
    Positions goals = now_.positions;
    hold_tips(kFirstWave, goals);
    factor(progress);
    report(progress, 0.5, Stage::fitting);
    solve(goals);
  }

  /// One stage with λ = wave. robust: w_C falls with the distance to the closest point, as a
  /// distant vertex may have no counterpart (FitGoals::robust_weights()). both_ways: by
  /// GoalFinder::both_ways().
  void run(double wave, bool robust, bool both_ways, const Progress& progress) {
    const auto goals = [&] { return both_ways ? finder_.both_ways(now_) : finder_.nearest(now_); };
    FitGoals found = goals();
    closeness_weights_.setConstant(vertex_count_, closeness_weight(wave));
    if (robust)
      closeness_weights_.array() *= found.robust_weights(now_.positions, edge_length_ / 2).array();
    hold_tips(wave, found.positions);
    factor(progress);
    for (int round = 0; round < options_.rounds; ++round) {
      report(progress, 0.5 + 0.5 * round / options_.rounds, Stage::fitting);
      if (round > 0) found = goals();
      hold_tips(wave, found.positions);
      solve(found.positions);
    }
  }

  /// A stage before all others, by the goals of set_guide().
  void run_guided(const Progress& progress) {
    closeness_weights_.setConstant(vertex_count_, closeness_weight(kMapWave));
    factor(progress);
    report(progress, 0.5, Stage::fitting);
    solve(guided_goals());
  }

  const Positions& positions() const { return now_.positions; }
  /// Mean length of the source's edges.
  double edge_length() const { return edge_length_; }

 private:
  static std::vector<int> usable_triangles(const Mesh& mesh) {
    std::vector<int> usable;
    const std::vector<int> thin =
        triangle_metric(mesh.positions, mesh.triangles).degenerate;  // ascending
    for (int j = 0; j < mesh.triangle_count(); ++j)
      if (!std::binary_search(thin.begin(), thin.end(), j)) usable.push_back(j);
    if (usable.empty()) throw Error(Status::mesh, "The source has no triangle with an area");
    return usable;
  }

  /// Free: vertices with a usable triangle and no marker, and fourth points.
  void find_region(int vertex_count, const Pairs& markers) {
    std::vector<int> roles(static_cast<size_t>(tets_.vertex_count()), kFixed);
    for (Index k = 0; k < tets_.tets.size(); ++k) roles[tets_.tets.data()[k]] = kFree;
    for (const auto& [from, to] : markers) {
      roles[from] = kFixed;
      unknowns_.row(from) = target_.positions.row(to);
    }
    region_ = region_of_roles(std::move(roles), 0);
    vertex_count_ = vertex_count;
  }

  void build_energy(const Mesh& source, const std::vector<int>& usable) {
    const Index m = static_cast<Index>(usable.size());
    std::vector<int> usable_index(static_cast<size_t>(source.triangle_count()), -1);
    for (Index i = 0; i < m; ++i) usable_index[usable[size_t(i)]] = static_cast<int>(i);
    std::vector<Eigen::Triplet<double>> entries;
    const auto add = [&](int a, int b, double value) {
      for (int c = 0; c < 3; ++c) entries.emplace_back(3 * a + c, 3 * b + c, value);
    };
    const Edges edges(source.triangles);
    for (int edge = 0; edge < edges.count(); ++edge) {
      const Edges::Range sides = edges.of(edge);
      for (const Edges::HalfEdge* side = sides.begin() + 1; side < sides.end(); ++side) {
        const int a = usable_index[(side - 1)->triangle()], b = usable_index[side->triangle()];
        if (a < 0 || b < 0) continue;
        for (int own : {a, b}) add(own, own, options_.smoothness);
        add(a, b, -options_.smoothness);
        add(b, a, -options_.smoothness);
      }
    }
    for (int i = 0; i < m; ++i) add(i, i, options_.identity);
    SparseMatrix weights(3 * m, 3 * m);
    weights.setFromTriplets(entries.begin(), entries.end());
    const SparseMatrix operator_ = deformation_operator(tets_);
    energy_ = operator_.transpose() * weights * operator_;
    // The right-hand side of the identity's term is w_I G̃ᵀ I, and I = G̃ x at rest.
    to_identity_ = options_.identity * (operator_.transpose() * (operator_ * tets_.positions));
    block_ = free_block(energy_, region_);
    // Relative to each row's own diagonal entry: that of specks is large beside any w_C, so an
    // absolute weight would be lost there.
    anchoring_ = kAnchoringFraction * block_.diagonal();
  }

  void factor(const Progress& progress) {
    SparseMatrix block = block_;
    for (int r = 0; r < region_.free_count(); ++r) {
      const int v = region_.free[r];
      block.coeffRef(r, r) += anchoring_[r] + (v < vertex_count_ ? closeness_weights_[v] : 0);
    }
    BlockOptions how;
    how.pool = &pool_;
    how.symbolic = symbolic_;
    how.progress = within(progress, 0, 0.5);
    how.stage = Stage::fitting;
    std::unique_ptr<Dissection> dissection;
    if (!symbolic_) {
      dissection =
          std::make_unique<Dissection>(free_dissection(block, region_, tets_.positions, &pool_));
      how.dissection = dissection.get();
    }
    factor_ = std::make_unique<SparseCholesky>(factor_free_block(block, region_, how));
    symbolic_ = factor_->shared_symbolic();
  }

  void solve(const Positions& goals) {
    Positions held = unknowns_;
    for (int v : region_.free) held.row(v).setZero();
    RowMatrix right = to_identity_ - energy_ * held;
    for (int r = 0; r < region_.free_count(); ++r)
      right.row(region_.free[r]) += anchoring_[r] * unknowns_.row(region_.free[r]);
    for (Index v = 0; v < goals.rows(); ++v) right.row(v) += closeness_weights_[v] * goals.row(v);
    const RowMatrix solved = factor_->solve(free_rows(right, region_), &pool_);
    for (int r = 0; r < region_.free_count(); ++r) unknowns_.row(region_.free[r]) = solved.row(r);
    now_.positions = unknowns_.topRows(vertex_count_);
  }

  /// w_C. λ: wave.
  double closeness_weight(double wave) const {
    const double two_pi = 2 * kPi;
    return std::pow(edge_length_ * two_pi * two_pi / (wave * wave), 2) /
           (edge_length_ * edge_length_);
  }

  void hold_tips(double wave, Positions& goals) {
    if (wave < kMinWaveTipsHeld) return;
    for (const auto& [tip, target_vertex] : held_tips_) {
      closeness_weights_[tip] = closeness_weight(kLastWaveEdges * edge_length_);
      goals.row(tip) = target_.positions.row(target_vertex);
    }
  }

  /// Each vertex is displaced as its representative is.
  Positions guided_goals() const {
    Positions result = now_.positions;
    for (Index v = 0; v < vertex_count_; ++v) {
      const int representative = representatives_[size_t(v)];
      if (representative >= 0)
        result.row(v) +=
            representative_goals_.row(representative) - now_.positions.row(representative);
    }
    return result;
  }

  const RegistrationOptions& options_;
  ThreadPool pool_;
  const Mesh& target_;
  GoalFinder finder_;
  const Mesh& initial_mesh_;
  Mesh now_;
  TetMesh tets_;
  Positions initial_unknowns_, unknowns_;
  Pairs held_tips_;
  std::vector<int> representatives_;
  Positions representative_goals_;
  int vertex_count_ = 0;
  double edge_length_ = 0;
  Eigen::VectorXd closeness_weights_;  // w_C of each vertex
  Region region_;
  SparseMatrix energy_, block_;
  RowMatrix to_identity_;
  Eigen::VectorXd anchoring_;  // of each free row
  std::shared_ptr<const SymbolicCholesky> symbolic_;
  std::unique_ptr<SparseCholesky> factor_;
};

/// The stages that every fit consists of.
class FitStages {
 public:
  /// All must outlive this.
  FitStages(const Alignment& alignment, const RegistrationOptions& options,
            const Progress& progress)
      : alignment_(alignment), options_(options), progress_(progress) {}

  int fit_count() const { return 1 + by_markers() + by_tips() + by_map(); }
  bool by_markers() const { return alignment_.by_markers.has_value(); }
  bool by_tips() const { return !alignment_.tips.empty(); }
  bool by_map() const { return !alignment_.map_target.empty(); }
  /// Of all progress that of one fit.
  double fraction() const { return 0.98 / fit_count(); }

  /// begin: where its progress begins.
  Positions fit(Registration& registration, Lead lead, double begin) const {
    const Progress progress = within(progress_, begin, begin + fraction());
    const double last = std::min(kFirstWave, kLastWaveEdges * registration.edge_length());
    const double first = std::max(last, lead == Lead::map ? kFirstWaveAfterMap : kFirstWave);
    const double step = 0.98 / (options_.stages + 1);
    const bool robust = alignment_.lies_on && lead != Lead::map;
    if (lead == Lead::map)
      registration.run_guided(within(progress, 0.02, 0.02 + step));
    else if (lead != Lead::nothing)
      registration.run_marked(within(progress, 0.02, 0.02 + step));
    for (int stage = 1; stage <= options_.stages; ++stage) {
      const double done = options_.stages > 1 ? (stage - 1.0) / (options_.stages - 1) : 1;
      const double wave = first * std::pow(last / first, done);
      // Parts of the target without a counterpart must not attract.
      const bool both_ways = wave > kMinWaveBothWays && !alignment_.lies_on;
      registration.run(wave, robust, both_ways,
                       within(progress, 0.02 + step * stage, 0.02 + step * (stage + 1)));
    }
    return registration.positions();
  }

 private:
  const Alignment& alignment_;
  const RegistrationOptions& options_;
  const Progress& progress_;
};

/// Sets the goals of a registration to those of the alignment's map. start: the placed source.
void guide_by_map(const Alignment& alignment, const Mesh& start, const Mesh& target,
                  Registration& registration) {
  Positions goals = start.positions;
  for (Index v = 0; v < goals.rows(); ++v)
    if (const int map_target = alignment.map_target[size_t(v)]; map_target >= 0)
      goals.row(v) = target.positions.row(map_target);
  registration.set_guide(alignment.representative, std::move(goals));
}

}  // namespace

Positions register_onto(const Mesh& source, const Mesh& target, const Pairs& given,
                        const Alignment& alignment, const RegistrationOptions& options,
                        const Progress& progress) {
  const Pairs markers = checked_markers(given, source, target);
  const UnitBox box(target.positions);
  const Mesh unit = {box.into(target.positions), target.triangles};
  const auto placed = [&](const Similarity& placement) {
    return Mesh{box.into(placement.all(source.positions)), source.triangles};
  };
  const FitStages stages(alignment, options, progress);
  const double fraction = stages.fraction();
  const Mesh start = placed(alignment.placement);
  Registration registration(start, unit, markers, options);
  Positions fitted = stages.fit(registration, Lead::nothing, 0);
  // Few markers often shear the source, and many tell more than its shape; tips may be paired
  // wrongly. So mean confidence decides between the fits.
  const auto confidence_of = [&](const Positions& positions, double done) {
    Match match = match_triangles({positions, source.triangles}, unit, options.reach,
                                  options.threads, within(progress, done, done));
    doubt_stretched(match, source, positions);
    return mean_confidence(match, unit);
  };
  double confidence = stages.by_markers() || stages.by_tips() ? confidence_of(fitted, fraction) : 0;
  const auto keep_better = [&](Positions candidate, double done) {
    const double of_candidate = confidence_of(candidate, done);
    if (!(of_candidate > confidence)) return;
    confidence = of_candidate;
    fitted = std::move(candidate);
  };
  if (stages.by_markers()) {
    const Mesh placed_by_markers = placed(*alignment.by_markers);
    Registration by_markers(placed_by_markers, unit, markers, options);
    keep_better(stages.fit(by_markers, Lead::markers, fraction), 2 * fraction);
  }
  if (stages.by_tips()) {
    registration.reset();
    registration.set_held_tips(alignment.tips);
    const double begin = fraction * (1 + stages.by_markers());
    keep_better(stages.fit(registration, Lead::tips, begin), begin + fraction);
  }
  if (stages.by_map()) {
    registration.reset();
    registration.set_held_tips({});
    guide_by_map(alignment, start, unit, registration);
    Positions guided = stages.fit(registration, Lead::map, 0.98 - fraction);
    // Closest points are the better guess on similar shapes. But posed limbs are far from their
    // goals: they are compressed or, by robust weights, left behind unstretched.
    const double max_stretch_ratio = alignment.lies_on ? kMaxStretchRatioOfGuided : 1;
    if (mean_stretch(start, guided) < max_stretch_ratio * mean_stretch(start, fitted))
      fitted = std::move(guided);
  }
  report(progress, 1, Stage::done);
  return box.out_of(fitted);
}

Positions register_onto(const Mesh& source, const Mesh& target, const Pairs& markers,
                        const RegistrationOptions& options, const Progress& progress) {
  validate(source, MeshOf::source);
  validate(target, MeshOf::target);
  const Alignment alignment =
      align(source, target, markers, options.threads, within(progress, 0, 0.2));
  return register_onto(source, target, markers, alignment, options, within(progress, 0.2, 1));
}

}  // namespace dd
