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
constexpr double kAnchoring = 1e-9;
// A stage lets deformations of a wavelength and longer follow the closest points. The wavelengths
// shorten from the first stage to the last, as fractions of the target box's diagonal:
constexpr double kLongestWave = 1;          // first stage: the whole box
constexpr double kLongestAfterGuide = 0.5;  // first stage after one that followed the alignment
constexpr double kGuided = 0.4;             // the stage that follows the alignment's map
constexpr double kBothWays = 0.1;           // longer ones use closest points of source and target
constexpr double kTipsHeld = 0.1;    // longer ones hold paired tips of limbs at their partners
constexpr double kShortestWave = 4;  // last stage, in mean edge lengths of the source
// The fit led by the map is taken if it stretches the source less than the other fit or, on shapes
// that lie on one another, less than this many times as much: there closest points leave posed
// limbs behind unstretched.
constexpr double kWorthGuiding = 2;

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
        start_(source),
        now_(source) {
    const std::vector<int> usable = usable_triangles(source);
    tets_ = with_fourth_points(source, usable);
    unknowns_ = tets_.positions;
    find_region(source.vertex_count(), markers);
    first_ = unknowns_;
    build_energy(source, usable);
    edge_ = mean_edge_length(source.positions, source.triangles);
  }

  /// Sets the goals of run_guided(), in the unit box. centres: for each vertex, the one by whose
  /// displacement it is displaced; places: where each of those goes.
  void guide(std::vector<int> centres, Positions places) {
    centres_ = std::move(centres);
    places_ = std::move(places);
  }

  /// Sets vertices of the source that are held at vertices of the target while waves are long.
  void hold(Pairs tips) { tips_ = std::move(tips); }

  /// Resets all positions to those at the beginning.
  void begin_again() {
    unknowns_ = first_;
    now_.positions = start_.positions;
  }

  /// A stage without closest points: only the markers and the held tips attract.
  void run_marked(const Progress& progress) {
    pulls_.setZero(vertex_count_);
    Positions wanted = now_.positions;
    hold_tips(kLongestWave, wanted);
    factor(progress);
    report(progress, 0.5, Stage::fitting);
    solve(wanted);
  }

  /// One stage: waves of this length and longer follow the target. by_near: w_C falls with the
  /// distance to the closest point, as a distant vertex may have no counterpart
  /// (FitGoals::nearness()). both_ways: by GoalFinder::both_ways().
  void run(double wave, bool by_near, bool both_ways, const Progress& progress) {
    const auto goals = [&] { return both_ways ? finder_.both_ways(now_) : finder_.nearest(now_); };
    FitGoals found = goals();
    pulls_.setConstant(vertex_count_, pull_of(wave));
    if (by_near) pulls_.array() *= found.nearness(now_.positions, edge_ / 2).array();
    hold_tips(wave, found.places);
    factor(progress);
    for (int round = 0; round < options_.rounds; ++round) {
      report(progress, 0.5 + 0.5 * round / options_.rounds, Stage::fitting);
      if (round > 0) found = goals();
      hold_tips(wave, found.places);
      solve(found.places);
    }
  }

  /// A stage before all others, by the goals of guide().
  void run_guided(const Progress& progress) {
    pulls_.setConstant(vertex_count_, pull_of(kGuided));
    factor(progress);
    report(progress, 0.5, Stage::fitting);
    solve(guided_goals());
  }

  const Positions& positions() const { return now_.positions; }
  /// Mean length of the source's edges.
  double edge() const { return edge_; }

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
    region_ = region_of(std::move(roles), 0);
    vertex_count_ = vertex_count;
  }

  void build_energy(const Mesh& source, const std::vector<int>& usable) {
    const Index m = static_cast<Index>(usable.size());
    std::vector<int> number(static_cast<size_t>(source.triangle_count()), -1);
    for (Index i = 0; i < m; ++i) number[usable[size_t(i)]] = static_cast<int>(i);
    std::vector<Eigen::Triplet<double>> entries;
    const auto add = [&](int a, int b, double value) {
      for (int c = 0; c < 3; ++c) entries.emplace_back(3 * a + c, 3 * b + c, value);
    };
    const Edges edges(source.triangles);
    for (int edge = 0; edge < edges.count(); ++edge) {
      const Edges::Range sides = edges.of(edge);
      for (const Edges::HalfEdge* side = sides.begin() + 1; side < sides.end(); ++side) {
        const int a = number[(side - 1)->triangle()], b = number[side->triangle()];
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
    anchoring_ = kAnchoring * block_.diagonal();
  }

  void factor(const Progress& progress) {
    SparseMatrix block = block_;
    for (int r = 0; r < region_.free_count(); ++r) {
      const int v = region_.free[r];
      block.coeffRef(r, r) += anchoring_[r] + (v < vertex_count_ ? pulls_[v] : 0);
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

  void solve(const Positions& wanted) {
    Positions held = unknowns_;
    for (int v : region_.free) held.row(v).setZero();
    RowMatrix right = to_identity_ - energy_ * held;
    for (int r = 0; r < region_.free_count(); ++r)
      right.row(region_.free[r]) += anchoring_[r] * unknowns_.row(region_.free[r]);
    for (Index v = 0; v < wanted.rows(); ++v) right.row(v) += pulls_[v] * wanted.row(v);
    const RowMatrix solved = factor_->solve(free_rows(right, region_), &pool_);
    for (int r = 0; r < region_.free_count(); ++r) unknowns_.row(region_.free[r]) = solved.row(r);
    now_.positions = unknowns_.topRows(vertex_count_);
  }

  double pull_of(double wave) const {
    const double two_pi = 2 * kPi;
    return std::pow(edge_ * two_pi * two_pi / (wave * wave), 2) / (edge_ * edge_);
  }

  void hold_tips(double wave, Positions& wanted) {
    if (wave < kTipsHeld) return;
    for (const auto& [tip, partner] : tips_) {
      pulls_[tip] = pull_of(kShortestWave * edge_);
      wanted.row(tip) = target_.positions.row(partner);
    }
  }

  /// Each vertex is displaced as its centre is.
  Positions guided_goals() const {
    Positions result = now_.positions;
    for (Index v = 0; v < vertex_count_; ++v) {
      const int centre = centres_[size_t(v)];
      if (centre >= 0) result.row(v) += places_.row(centre) - now_.positions.row(centre);
    }
    return result;
  }

  const RegistrationOptions& options_;
  ThreadPool pool_;
  const Mesh& target_;
  GoalFinder finder_;
  const Mesh& start_;
  Mesh now_;
  TetMesh tets_;
  Positions first_, unknowns_;
  Pairs tips_;
  std::vector<int> centres_;
  Positions places_;
  int vertex_count_ = 0;
  double edge_ = 0;
  Eigen::VectorXd pulls_;  // w_C of each vertex
  Region region_;
  SparseMatrix energy_, block_;
  RowMatrix to_identity_;
  Eigen::VectorXd anchoring_;  // of each free row
  std::shared_ptr<const SymbolicCholesky> symbolic_;
  std::unique_ptr<SparseCholesky> factor_;
};

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
  const bool mapped = !alignment.partner.empty(), marked = alignment.by_markers.has_value(),
             has_tips = !alignment.tips.empty();
  const double share = 0.98 / (1 + marked + has_tips + mapped);
  const auto fit = [&](Registration& by, Lead lead, double begin) {
    const Progress part = within(progress, begin, begin + share);
    const double last = std::min(kLongestWave, kShortestWave * by.edge());
    const double first = std::max(last, lead == Lead::map ? kLongestAfterGuide : kLongestWave);
    const double step = 0.98 / (options.stages + 1);
    const bool by_near = alignment.lies_on && lead != Lead::map;
    if (lead == Lead::map)
      by.run_guided(within(part, 0.02, 0.02 + step));
    else if (lead != Lead::nothing)
      by.run_marked(within(part, 0.02, 0.02 + step));
    for (int stage = 1; stage <= options.stages; ++stage) {
      const double done = options.stages > 1 ? (stage - 1.0) / (options.stages - 1) : 1;
      const double wave = first * std::pow(last / first, done);
      // Parts of the target without a counterpart must not attract.
      const bool both_ways = wave > kBothWays && !alignment.lies_on;
      by.run(wave, by_near, both_ways,
             within(part, 0.02 + step * stage, 0.02 + step * (stage + 1)));
    }
    return by.positions();
  };
  const Mesh start = placed(alignment.placement);
  Registration registration(start, unit, markers, options);
  Positions fitted = fit(registration, Lead::nothing, 0);
  // Few markers often shear the source, and many tell more than its shape; tips may be paired
  // wrongly. So mean confidence decides between the fits.
  const auto trust_in = [&](const Positions& positions, double done) {
    Match match = match_triangles({positions, source.triangles}, unit, options.reach,
                                  options.threads, within(progress, done, done));
    doubt_stretched(match, source, positions);
    return mean_confidence(match, unit);
  };
  double trust = marked || has_tips ? trust_in(fitted, share) : 0;
  const auto keep_better = [&](Positions led, double done) {
    const double led_trust = trust_in(led, done);
    if (!(led_trust > trust)) return;
    trust = led_trust;
    fitted = std::move(led);
  };
  if (marked) {
    const Mesh there = placed(*alignment.by_markers);
    Registration by_markers(there, unit, markers, options);
    keep_better(fit(by_markers, Lead::markers, share), 2 * share);
  }
  if (has_tips) {
    registration.begin_again();
    registration.hold(alignment.tips);
    const double begin = share * (1 + marked);
    keep_better(fit(registration, Lead::tips, begin), begin + share);
  }
  if (mapped) {
    registration.begin_again();
    registration.hold({});
    Positions places = start.positions;
    for (Index v = 0; v < places.rows(); ++v)
      if (const int partner = alignment.partner[size_t(v)]; partner >= 0)
        places.row(v) = unit.positions.row(partner);
    registration.guide(alignment.centre, std::move(places));
    Positions guided = fit(registration, Lead::map, 0.98 - share);
    // Closest points are the better guess on similar shapes. But posed limbs are far from their
    // goals: they are compressed or, by robust weights, left behind unstretched.
    const double worth = alignment.lies_on ? kWorthGuiding : 1;
    if (mean_stretch(start, guided) < worth * mean_stretch(start, fitted))
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
