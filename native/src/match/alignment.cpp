// SPDX-License-Identifier: GPL-3.0-or-later
#include "match/alignment.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include "match/limb_tips.h"
#include "match/map_search.h"
#include "match/placement.h"
#include "mesh/unit_box.h"
#include "support/thread_pool.h"

namespace dd {

namespace {

// Stretch (stretch_of()) of a functional map below which it may guide the registration.
constexpr double kMaxGuidingStretch = 0.14;
// Maps are ambiguous if their stretches differ by less. Tuned: rough maps of exact symmetries,
// whose stretch should be 0, have up to half of it.
constexpr double kAmbiguousStretchDifference = 0.05;
// A map is dropped if its Candidate::orientation is less than this fraction of the largest one.
constexpr double kMinOrientationRatio = 0.3;

/// Indices of the candidates that don't turn the surface inside out, the best first; at least one.
std::vector<size_t> orientation_preserving(const std::vector<Candidate>& candidates) {
  double most = 0;
  for (const Candidate& candidate : candidates) most = std::max(most, candidate.orientation);
  std::vector<size_t> preserving;
  for (size_t i = 0; i < candidates.size(); ++i)
    if (candidates[i].orientation >= kMinOrientationRatio * most) preserving.push_back(i);
  if (preserving.empty()) preserving.push_back(0);  // each turns over more area than it keeps
  std::stable_sort(preserving.begin(), preserving.end(), [&](size_t a, size_t b) {
    return candidates[a].preferred() < candidates[b].preferred();
  });
  return preserving;
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
size_t best_of(const std::vector<Candidate>& candidates, std::vector<size_t>& rivals) {
  const std::vector<size_t> preserving = orientation_preserving(candidates);
  const size_t best = preserving.front();
  for (size_t i : preserving)
    if (i != best && candidates[i].fits_about_as(candidates[best]) &&
        candidates[i].stretch < candidates[best].stretch + kAmbiguousStretchDifference)
      rivals.push_back(i);
  return best;
}

/// The opposite of in_boxes(): the placement in the meshes' units.
Similarity in_units(const Similarity& in_unit_boxes, const UnitBox (&boxes)[2]) {
  Similarity placement = in_unit_boxes;
  placement.scale = in_unit_boxes.scale * boxes[1].scale / boxes[0].scale;
  placement.shift = boxes[1].scale * in_unit_boxes.shift + boxes[1].centre.transpose() -
                    placement.scale * (in_unit_boxes.rotation * boxes[0].centre.transpose());
  return placement;
}

/// Two coarse shapes to be aligned, with their markers.
struct ShapePair {
  ShapePair(const Mesh& source_mesh, const Mesh& target_mesh, const Pairs& markers)
      : source(source_mesh),
        target(target_mesh),
        boxes{UnitBox(source_mesh.positions), UnitBox(target_mesh.positions)} {
    const Index count = static_cast<Index>(markers.size());
    marker_positions = {Positions(count, 3), Positions(count, 3)};
    for (Index i = 0; i < count; ++i) {
      const auto& [one, other] = markers[size_t(i)];
      marker_positions.source.row(i) = boxes[0].into(source_mesh.positions.row(one));
      marker_positions.target.row(i) = boxes[1].into(target_mesh.positions.row(other));
      if (source.of_vertex[one] >= 0 && target.of_vertex[other] >= 0)
        marked.push_back({source.of_vertex[one], target.of_vertex[other]});
    }
  }
  CoarseShape source, target;
  UnitBox boxes[2];
  MarkerPositions marker_positions;
  Pairs marked;  // vertices of the coarse shapes
};

void add_placement_candidates(const ShapePair& shapes, const MarkerPositions& marked,
                              ThreadPool& pool, std::vector<Placement>& placements) {
  const std::vector<Placement> more =
      placement_candidates(shapes.source, shapes.target, marked, pool);
  placements.insert(placements.end(), more.begin(), more.end());
}

/// The candidates whose maps are searched. placed: candidates by markers and closest points.
std::vector<Candidate> candidates_to_map(const ShapePair& shapes,
                                         const std::vector<Placement>& placed, ThreadPool& pool) {
  std::vector<Placement> placements = placed;
  if (shapes.marker_positions.source.rows() > 0) {
    // A similarity that is fitted to the markers of posed limbs is far from each of them. So
    // placements that ignore the markers are candidates, too, and all are compared without the
    // markers' residuals. Only the maps that are grown from them have to keep the markers.
    add_placement_candidates(shapes, {}, pool, placements);
    for (Placement& placement : placements)
      remeasure_without_markers(placement, shapes.source, shapes.target);
  }
  return {placements.begin(), placements.end()};
}

/// The candidates without maps: those of mirrored sources only serve to begin maps.
std::vector<Candidate> unmirrored(const std::vector<Placement>& placed) {
  std::vector<Candidate> candidates;
  for (const Placement& placement : placed)
    if (!placement.mirrored) candidates.emplace_back(placement);
  return candidates;
}

/// A partial fit from the placements or, if there is none, of an open surface that lies on the
/// other one by the meshes' own coordinates or by the given placement.
std::optional<PartialFit> find_partial_fit(const ShapePair& shapes,
                                           const std::vector<Placement>& placed,
                                           const Similarity* given_placement, ThreadPool& pool) {
  std::optional<PartialFit> found =
      fit_partially(placed, shapes.source, shapes.target, shapes.marker_positions, pool);
  const auto try_placement = [&](const Similarity& placement) {
    const Similarity in_unit_boxes = in_boxes(placement, shapes.boxes);
    if (!found &&
        part_lies_on_whole(shapes.source, shapes.target, shapes.marker_positions, in_unit_boxes))
      found = PartialFit{in_unit_boxes, false};
  };
  try_placement(Similarity());
  if (given_placement && !given_placement->mirrored) try_placement(*given_placement);
  return found;
}

/// Sets the alignment's map. target_rows: the coarse target vertex of each coarse source vertex.
void set_map(const ShapePair& shapes, const std::vector<int>& target_rows, Alignment& alignment) {
  for (int c : shapes.source.of_vertex) {
    alignment.representative.push_back(c < 0 ? -1 : shapes.source.vertices[size_t(c)]);
    alignment.map_target.push_back(c < 0 ? -1
                                         : shapes.target.vertices[size_t(target_rows[size_t(c)])]);
  }
}

void set_tips(const ShapePair& shapes, const Similarity& placement, Alignment& alignment) {
  for (const auto& [one, other] :
       paired_tips(shapes.source, shapes.target, placement, shapes.marked))
    alignment.tips.push_back(
        {shapes.source.vertices[size_t(one)], shapes.target.vertices[size_t(other)]});
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
                const Progress& progress, const Similarity* given_placement) {
  report(progress, 0.01, Stage::meshes);
  const Pairs markers = checked_markers(given, source, target);
  const ShapePair shapes(source, target, markers);
  const MarkerPositions& marker_positions = shapes.marker_positions;
  ThreadPool pool(threads);
  MapSearch map_search(shapes.source, shapes.target, shapes.marked, pool);
  const bool mapped = map_search.compute_bases(within(progress, 0.1, 0.3));
  report(progress, 0.3, Stage::placing);
  std::vector<Placement> placed;
  if (marker_positions.suffice())
    placed.push_back(placement_by(marker_positions, shapes.source, shapes.target));
  if (mapped || placed.empty()) add_placement_candidates(shapes, marker_positions, pool, placed);

  std::vector<Candidate> candidates;
  if (mapped) {
    candidates = candidates_to_map(shapes, placed, pool);
    map_search.search_maps(candidates, within(progress, 0.5, 0.8));
    report(progress, 0.8, Stage::map);
    candidates = map_search.finely_mapped(candidates, orientation_preserving(candidates));
  } else {
    candidates = unmirrored(placed);
  }
  std::vector<size_t> rivals;
  const Candidate& best = candidates[best_of(candidates, rivals)];
  const double stretch = mapped ? best.stretch : kMaxGuidingStretch;
  const bool guides = stretch < kMaxGuidingStretch;
  std::optional<PartialFit> partial_fit;
  if (!(stretch < kConvincingStretch))
    partial_fit = find_partial_fit(shapes, placed, given_placement, pool);

  Alignment result;
  result.lies_on = partial_fit.has_value();
  result.placement =
      in_units(partial_fit ? partial_fit->similarity : best.similarity, shapes.boxes);
  if (marker_positions.suffice())
    result.by_markers = in_units(placed.front().similarity, shapes.boxes);
  result.ambiguous = partial_fit ? partial_fit->ambiguous : !mapped && !rivals.empty();
  if (!mapped || (partial_fit && !guides)) return result;
  const std::vector<int> target_rows = map_search.nearest(best.map).of_first;
  for (size_t rival : rivals) {
    const std::vector<int>& images = candidates[rival].target_of;
    result.ambiguous |= map_search.keeps_markers(images) &&
                        map_search.mean_distance(target_rows, images) > kElsewhereDistance;
  }
  if (guides)
    set_map(shapes, target_rows, result);
  else
    set_tips(shapes, best.similarity, result);
  return result;
}

}  // namespace dd
