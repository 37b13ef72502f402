// SPDX-License-Identifier: GPL-3.0-or-later
#include "match/alignment.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include "match/functional_map.h"
#include "match/limb_tips.h"
#include "match/placement.h"
#include "match/spectral_basis.h"
#include "mesh/triangles.h"
#include "mesh/unit_box.h"
#include "support/thread_pool.h"

namespace dd {

namespace {

// Functional maps between the lowest eigenfunctions of the Laplacians grow (ZoomOut) from kFirst to
// kLast functions. All 2^(kFirst − 1) combinations of the first ones' signs are tried; more last
// ones resolve more and take longer.
constexpr int kFirst = 6, kLast = 30;
// Least vertices of the smaller coarse shape for each function: fewer don't resolve the last ones.
constexpr int kVerticesPerFunction = 6;
constexpr int kSpare = 20;  // further columns of the subspace iteration, so that the last converge
// Functions added at a time in the rough pass, which only compares maps, and in the fine one.
constexpr int kRoughStep = 3, kFineStep = 1;
// Samples of the rough pass. They tell only clearly different maps apart; the fine pass takes all.
constexpr size_t kRoughSamples = 250;
// Maps whose signs are varied: by the best map alone, two poses of a lion were laid wrongly, out of
// 20 poses of a horse, a cat and a lion.
constexpr size_t kCompared = 8;
// Maps of the fine pass, without which three poses of a horse, a cat and a lion were laid wrongly.
// It makes a match without markers half more work.
constexpr size_t kLookedAtClosely = 6;
// Mean distance below which two maps count as one, as a fraction of the box's diagonal.
constexpr double kAlikeMaps = 0.05;
// The stretch of a map (stretch_of()), 0 for an isometry. Below kConvincing, neither other signs
// nor lying_on() are tried; below kMeaningful, the map may guide the registration.
constexpr double kConvincing = 0.07, kMeaningful = 0.14;
// Maps are ambiguous if their stretches differ by less. Tuned: rough maps of exact symmetries,
// whose stretch should be 0, have up to half of it.
constexpr double kAlikeStretch = 0.05;
// A map is dropped if its kept_orientation() is less than this fraction of the largest one.
constexpr double kReversed = 0.3;

/// A candidate placement with its functional map.
struct Start : Placement {
  FunctionalMap map;
  std::vector<int> rows;  // its target vertex for each source vertex, one of kRoughSamples
  bool by_map = false;    // the similarity is fitted to the map
  double stretch = 0, orientation = 0;
  double score() const { return (misfit + kExact) * (stretch + kExact); }
  double preferred() const { return Placement::preferred() * (stretch + kExact); }
};

class Aligning {
 public:
  /// marked: pairs of vertices of the coarse shapes, from the markers.
  Aligning(const CoarseShape& source, const CoarseShape& target,
           std::vector<std::array<int, 2>> marked, ThreadPool& pool)
      : source_(source), target_(target), marked_(std::move(marked)), pool_(pool) {}

  /// Computes the eigenfunctions of both shapes. Returns false if a shape isn't connected or has
  /// too few vertices.
  bool find_functions(const Progress& progress) {
    const int fewest = std::min(source_.mesh.vertex_count(), target_.mesh.vertex_count());
    count_ = std::min(kLast, fewest / kVerticesPerFunction);
    if (count_ <= kFirst || !source_.connected || !target_.connected) return false;
    report(progress, 0, Stage::functions);
    for (int side = 0; side < 2; ++side) {
      const CoarseShape& shape = side == 0 ? source_ : target_;
      std::vector<int> seeds = shape.samples;
      seeds.resize(std::min(seeds.size(), static_cast<size_t>(count_ + kSpare)));
      bases_[side] = spectral_basis(shape.mesh, count_, seeds, &pool_);
    }
    return true;
  }

  void map_all(std::vector<Start>& starts, const Progress& progress) {
    report(progress, 0, Stage::placements);
    map_from(starts, 0);
    // A pose often brings the left one of two like halves to where the right one is at rest, and a
    // map that swaps them is an isometry, too. It differs from the correct map in the signs
    // of eigenfunctions.
    std::vector<Start> ordered = starts;
    std::stable_sort(ordered.begin(), ordered.end(),
                     [](const Start& a, const Start& b) { return a.score() < b.score(); });
    if (ordered[0].orientation > 0 && ordered[0].stretch < kConvincing) return;
    report(progress, 0.5, Stage::sides);
    const size_t known = starts.size();
    for (const Start& base : differing(ordered, kCompared))
      for (int signs = 1; signs < 1 << (kFirst - 1); ++signs) {
        starts.push_back(base);
        Eigen::MatrixXd& matrix = starts.back().map.matrix;
        // Moved: where an allocation fails in a copy assignment, Eigen frees twice.
        matrix = Eigen::MatrixXd(matrix.topLeftCorner(kFirst, kFirst));
        for (int k = 1; k < kFirst; ++k)
          if (signs >> (k - 1) & 1) matrix.col(k) *= -1;
      }
    map_from(starts, known);
  }

  /// Maps starts[begin] and those after it. One that has a map already is refined from it.
  void map_from(std::vector<Start>& starts, size_t begin) {
    pool_.run(static_cast<int>(starts.size() - begin), [&](int i) {
      Start& start = starts[begin + size_t(i)];
      start.by_map = begin > 0 || start.mirrored;
      look(start, kRoughSamples, kRoughStep);
    });
  }

  /// The first distinct candidates, mapped from all samples, as rough maps tell only much worse
  /// ones apart. If any map keeps the markers, only those that do. upright: upright_of(starts).
  std::vector<Start> looked_at_closely(const std::vector<Start>& starts,
                                       const std::vector<size_t>& upright) {
    std::vector<Start> ordered;
    ordered.reserve(upright.size());
    for (const size_t i : upright) ordered.push_back(starts[i]);
    std::vector<Start> few = differing(ordered, kLookedAtClosely);
    pool_.run(static_cast<int>(few.size()),
              [&](int i) { look(few[size_t(i)], source_.samples.size(), kFineStep); });
    const auto astray = std::stable_partition(
        few.begin(), few.end(), [&](const Start& one) { return keeps_markers(one.rows); });
    if (astray != few.begin()) few.erase(astray, few.end());
    return few;
  }

  /// Up to `most` candidates from the first on, each with a map that differs from those before it
  /// (kAlikeMaps).
  std::vector<Start> differing(const std::vector<Start>& ordered, size_t most) const {
    std::vector<Start> few;
    for (const Start& start : ordered) {
      const bool known = std::any_of(few.begin(), few.end(), [&](const Start& other) {
        return apart(start.rows, other.rows) < kAlikeMaps;
      });
      if (!known && few.size() < most) few.push_back(start);
    }
    return few;
  }

  void look(Start& start, size_t samples, int step) {
    find_map(start, samples, step);
    start.rows = roughly_nearest(start.map);
    start.orientation = kept_orientation(start.rows);
    start.as_they_stand = stands(start.rows);
    if (start.by_map) start.similarity = fitted(start.rows);
  }

  void find_map(Start& start, size_t samples, int step) {
    const Positions from = start.samples(source_, samples);
    const Positions onto = rows_of(target_.mesh.positions, target_.samples, samples);
    SampledFunctions sampled = {rows_of(bases_[0].functions, source_.samples, samples),
                                rows_of(bases_[1].functions, target_.samples, samples),
                                {}};
    for (const auto& [of_source, of_target] : marked_)
      sampled.landmarks.push_back(
          {bases_[0].functions.row(of_source), bases_[1].functions.row(of_target)});
    const NearestRows rows =
        start.map.size() == 0
            ? nearest_rows(from, onto)
            : nearest_rows(start.map(sampled.source), sampled.target.leftCols(start.map.size()));
    start.map = zoomed_out(sampled, rows, kFirst, count_, step);
    start.stretch = stretch_of(start.map, bases_[0].values, bases_[1].values);
  }

  /// The corresponding vertex of each vertex of both shapes.
  NearestRows nearest(const FunctionalMap& map) const {
    return nearest_rows(map(bases_[0].functions), bases_[1].functions);
  }

  /// For each source vertex the target vertex with the nearest values of the eigenfunctions among
  /// kRoughSamples samples.
  std::vector<int> roughly_nearest(const FunctionalMap& map) const {
    std::vector<int> rows =
        nearest_rows(map(bases_[0].functions),
                     rows_of(bases_[1].functions, target_.samples, kRoughSamples))
            .of_first;
    for (int& row : rows) row = target_.samples[size_t(row)];
    return rows;
  }

  /// Mean distance between the images of the source's vertices by two maps, in the target's box.
  double apart(const std::vector<int>& one, const std::vector<int>& other) const {
    double sum = 0;
    for (size_t i = 0; i < one.size(); ++i)
      sum += (target_.mesh.positions.row(one[i]) - target_.mesh.positions.row(other[i])).norm();
    return sum / static_cast<double>(one.size());
  }

  /// Whether a map takes each marker to within kElsewhere / 2 of its partner.
  bool keeps_markers(const std::vector<int>& rows) const {
    return std::all_of(marked_.begin(), marked_.end(), [&](const std::array<int, 2>& pair) {
      return (target_.mesh.positions.row(rows[size_t(pair[0])]) -
              target_.mesh.positions.row(pair[1]))
                 .norm() < kElsewhere / 2;
    });
  }

 private:
  Similarity fitted(const std::vector<int>& rows) const {
    Positions onto(source_.mesh.vertex_count(), 3);
    for (Index v = 0; v < onto.rows(); ++v)
      onto.row(v) = target_.mesh.positions.row(rows[size_t(v)]);
    return fitted_similarity(source_.mesh.positions, onto, Eigen::VectorXd::Ones(onto.rows()));
  }

  /// Whether the similarity fitted to a map turns the source by less than 45°.
  bool stands(const std::vector<int>& rows) const {
    return fitted(rows).rotation.trace() > 1 + 2 * std::sqrt(0.5);
  }

  /// In [−1, 1]: the source's area whose image keeps its orientation less that whose image is
  /// turned over, as a fraction of the whole.
  double kept_orientation(const std::vector<int>& rows) const {
    double sum = 0;
    for (int j = 0; j < source_.mesh.triangle_count(); ++j) {
      Eigen::Matrix3d corners;
      Eigen::Vector3d normal = Eigen::Vector3d::Zero();
      for (int k = 0; k < 3; ++k) {
        const int v = rows[size_t(source_.mesh.triangles(j, k))];
        corners.col(k) = target_.mesh.positions.row(v).transpose();
        normal += target_.normals.row(v).transpose().normalized();
      }
      const double side =
          normal.dot(edges_and_normal(corners.col(0), corners.col(1), corners.col(2)).col(2));
      if (side != 0) sum += side > 0 ? source_.areas[j] : -source_.areas[j];
    }
    return sum / source_.areas.sum();
  }

  const CoarseShape &source_, &target_;
  std::vector<std::array<int, 2>> marked_;
  ThreadPool& pool_;
  SpectralBasis bases_[2];
  int count_ = 0;
};

/// Indices of the candidates that don't turn the surface inside out, the best first; at least one.
std::vector<size_t> upright_of(const std::vector<Start>& starts) {
  double most = 0;
  for (const Start& start : starts) most = std::max(most, start.orientation);
  std::vector<size_t> upright;
  for (size_t i = 0; i < starts.size(); ++i)
    if (starts[i].orientation >= kReversed * most) upright.push_back(i);
  if (upright.empty()) upright.push_back(0);  // each turns over more area than it keeps
  std::stable_sort(upright.begin(), upright.end(), [&](size_t a, size_t b) {
    return starts[a].preferred() < starts[b].preferred();
  });
  return upright;
}

/// A placement of the source on the target, as a map from the source's unit box to the target's.
Similarity in_boxes(const Similarity& placement, const UnitBox (&boxes)[2]) {
  Similarity result = placement;
  result.scale = placement.scale * boxes[0].scale / boxes[1].scale;
  result.shift =
      (placement(boxes[0].centre.transpose()) - boxes[1].centre.transpose()) / boxes[1].scale;
  return result;
}

/// The index of the best candidate. rivals: gets those that are about as good.
size_t best_of(const std::vector<Start>& starts, std::vector<size_t>& rivals) {
  const std::vector<size_t> upright = upright_of(starts);
  const size_t best = upright.front();
  for (size_t i : upright)
    if (i != best && starts[i].fits_about_as(starts[best]) &&
        starts[i].stretch < starts[best].stretch + kAlikeStretch)
      rivals.push_back(i);
  return best;
}

}  // namespace

Pairs checked_markers(Pairs markers, const Mesh& source, const Mesh& target) {
  const int count[2] = {source.vertex_count(), target.vertex_count()};
  for (size_t i = 0; i < markers.size(); ++i)
    for (int side = 0; side < 2; ++side)
      if (markers[i][side] < 0 || markers[i][side] >= count[side])
        throw Error(Status::argument, {Subject::pair, Index(i)},
                    "of markers names vertex " + std::to_string(markers[i][side]) + " of the " +
                        (side == 0 ? "source" : "target") + ", which has " +
                        std::to_string(count[side]),
                    Remedy::call);
  std::sort(markers.begin(), markers.end());
  markers.erase(std::unique(markers.begin(), markers.end()), markers.end());
  for (size_t i = 1; i < markers.size(); ++i)
    if (markers[i][0] == markers[i - 1][0])
      throw Error(Status::argument, {Subject::source_vertex, markers[i][0]},
                  "is paired by markers with the vertices " + std::to_string(markers[i - 1][1]) +
                      " and " + std::to_string(markers[i][1]) + " of the target",
                  Remedy::correct_markers);
  return markers;
}

bool marked_as_mirror_image(const Mesh& source, const Mesh& target, const Pairs& given) {
  const Pairs markers = checked_markers(given, source, target);
  const Index count = static_cast<Index>(markers.size());
  Positions from(count, 3), to(count, 3);
  for (Index i = 0; i < count; ++i) {
    from.row(i) = source.positions.row(markers[size_t(i)][0]);
    to.row(i) = target.positions.row(markers[size_t(i)][1]);
  }
  return is_mirror_image(from, to, Eigen::VectorXd::Ones(count));
}

Alignment align(const Mesh& source, const Mesh& target, const Pairs& given, int threads,
                const Progress& progress, const Similarity* stance) {
  report(progress, 0.01, Stage::meshes);
  const Pairs markers = checked_markers(given, source, target);
  const CoarseShape from(source), onto(target);
  const UnitBox boxes[2] = {UnitBox(source.positions), UnitBox(target.positions)};
  const Index count = static_cast<Index>(markers.size());
  MarkedPlaces places = {Positions(count, 3), Positions(count, 3)};
  Pairs marked;
  for (Index i = 0; i < count; ++i) {
    const auto& [one, other] = markers[size_t(i)];
    places.source.row(i) = boxes[0].into(source.positions.row(one));
    places.target.row(i) = boxes[1].into(target.positions.row(other));
    if (from.of_vertex[one] >= 0 && onto.of_vertex[other] >= 0)
      marked.push_back({from.of_vertex[one], onto.of_vertex[other]});
  }
  ThreadPool pool(threads);
  Aligning aligning(from, onto, marked, pool);
  const bool mapped = aligning.find_functions(within(progress, 0.1, 0.3));
  report(progress, 0.3, Stage::placing);
  std::vector<Placement> placed;
  if (places.suffice()) placed.push_back(placement_by(places, from, onto));
  const auto add_placements = [&](std::vector<Placement>& all, const MarkedPlaces& marks) {
    const std::vector<Placement> more = placements(from, onto, marks, pool);
    all.insert(all.end(), more.begin(), more.end());
  };
  if (mapped || placed.empty()) add_placements(placed, places);
  std::vector<Placement> begun = placed;
  if (mapped && count > 0) {
    // No similarity fits the markers of posed limbs. So placements without markers are candidates,
    // too, and only their maps have to keep the markers.
    add_placements(begun, {});
    for (Placement& one : begun) measure_by_shape(one, from, onto);
  }
  std::vector<Start> starts;
  starts.reserve(begun.size());
  for (const Placement& one : begun) starts.push_back({one, {}, {}, false, 0, 0});

  Alignment result;
  std::vector<size_t> rivals;
  if (mapped) aligning.map_all(starts, within(progress, 0.5, 0.8));
  if (!mapped)  // only a map makes a placement of a mirrored candidate
    starts.erase(std::remove_if(starts.begin(), starts.end(),
                                [](const Start& start) { return start.mirrored; }),
                 starts.end());
  if (mapped) {
    report(progress, 0.8, Stage::map);
    starts = aligning.looked_at_closely(starts, upright_of(starts));
  }
  const size_t best = best_of(starts, rivals);
  const double stretch = mapped ? starts[best].stretch : kMeaningful;
  std::optional<Lying> lying;
  if (!(stretch < kConvincing)) {
    lying = lying_on(placed, from, onto, places, pool);
    const auto stand = [&](const Similarity& in_units_of_meshes) {
      const Similarity standing = in_boxes(in_units_of_meshes, boxes);
      if (!lying && stands_on(from, onto, places, standing)) lying = Lying{standing, false};
    };
    stand(Similarity());
    if (stance && !stance->mirrored) stand(*stance);
  }
  result.lies_on = lying.has_value();
  const auto in_units = [&](const Similarity& unit) {
    Similarity placement = unit;
    placement.scale = unit.scale * boxes[1].scale / boxes[0].scale;
    placement.shift = boxes[1].scale * unit.shift + boxes[1].centre.transpose() -
                      placement.scale * (unit.rotation * boxes[0].centre.transpose());
    return placement;
  };
  result.placement = in_units(lying ? lying->similarity : starts[best].similarity);
  if (places.suffice()) result.by_markers = in_units(placed.front().similarity);
  const bool guides = stretch < kMeaningful;
  result.ambiguous = lying ? lying->ambiguous : !mapped && !rivals.empty();
  if (!mapped || (lying && !guides)) return result;
  const NearestRows rows = aligning.nearest(starts[best].map);
  for (size_t rival : rivals) {
    const std::vector<int>& there = starts[rival].rows;
    result.ambiguous |=
        aligning.keeps_markers(there) && aligning.apart(rows.of_first, there) > kElsewhere;
  }
  if (!guides) {
    for (const auto& [one, other] : paired_tips(from, onto, starts[best].similarity, marked))
      result.tips.push_back({from.vertices[size_t(one)], onto.vertices[size_t(other)]});
    return result;
  }
  for (int c : from.of_vertex) {
    result.centre.push_back(c < 0 ? -1 : from.vertices[size_t(c)]);
    result.partner.push_back(c < 0 ? -1 : onto.vertices[size_t(rows.of_first[size_t(c)])]);
  }
  return result;
}

}  // namespace dd
