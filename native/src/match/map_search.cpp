// SPDX-License-Identifier: GPL-3.0-or-later
#include "match/map_search.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "mesh/triangles.h"

namespace dd {

namespace {

// A functional map is a matrix between the first eigenfunctions of both Laplacians, of the lowest
// eigenvalues. ZoomOut begins with matrices of kFirstFunctions functions, of which all
// 2^(kFirstFunctions − 1) combinations of signs are tried, and ends with kLastFunctions: more
// resolve more and take longer.
constexpr int kFirstFunctions = 6, kLastFunctions = 30;
// Least vertices of the smaller coarse shape for each function: fewer don't resolve the last ones.
constexpr int kVerticesPerFunction = 6;
// Further columns of the subspace iteration, so that the last function converges.
constexpr int kSpareFunctions = 20;
// Functions added at a time in the rough pass, which only compares maps, and in the fine one.
constexpr int kRoughStep = 3, kFineStep = 1;
// Samples of the rough pass. They tell only clearly different maps apart; the fine pass takes all.
constexpr size_t kRoughSamples = 250;
// Maps whose signs are varied: by the best map alone, two poses of a lion were laid wrongly, out of
// 20 poses of a horse, a cat and a lion.
constexpr size_t kMaxSignVaried = 8;
// Maps of the fine pass, without which three poses of a horse, a cat and a lion were laid wrongly.
// It makes a match without markers half more work.
constexpr size_t kMaxFinelyMapped = 6;
// Mean distance of the images of a vertex by two maps below which they count as one map, as a
// fraction of the diagonal of the target's box.
constexpr double kSameMapDistance = 0.05;

}  // namespace

bool MapSearch::compute_bases(const Progress& progress) {
  const int fewest = std::min(source_.mesh.vertex_count(), target_.mesh.vertex_count());
  count_ = std::min(kLastFunctions, fewest / kVerticesPerFunction);
  if (count_ <= kFirstFunctions || !source_.connected || !target_.connected) return false;
  report(progress, 0, Stage::functions);
  for (int side = 0; side < 2; ++side) {
    const CoarseShape& shape = side == 0 ? source_ : target_;
    std::vector<int> seeds = shape.samples;
    seeds.resize(std::min(seeds.size(), static_cast<size_t>(count_ + kSpareFunctions)));
    bases_[side] = spectral_basis(shape.mesh, count_, seeds, &pool_);
  }
  return true;
}

void MapSearch::search_maps(std::vector<Candidate>& candidates, const Progress& progress) {
  report(progress, 0, Stage::placements);
  map_from(candidates, 0);
  // A pose often brings the left one of two like halves to where the right one is at rest, and a
  // map that swaps them is an isometry, too. It differs from the correct map in the signs
  // of eigenfunctions.
  std::vector<Candidate> ordered = candidates;
  std::stable_sort(ordered.begin(), ordered.end(),
                   [](const Candidate& a, const Candidate& b) { return a.score() < b.score(); });
  if (ordered[0].orientation > 0 && ordered[0].stretch < kConvincingStretch) return;
  report(progress, 0.5, Stage::sides);
  const size_t known = candidates.size();
  for (const Candidate& base : distinct(ordered, kMaxSignVaried))
    for (int signs = 1; signs < 1 << (kFirstFunctions - 1); ++signs) {
      candidates.push_back(base);
      Eigen::MatrixXd& matrix = candidates.back().map.matrix;
      // Moved: where an allocation fails in a copy assignment, Eigen frees twice.
      matrix = Eigen::MatrixXd(matrix.topLeftCorner(kFirstFunctions, kFirstFunctions));
      for (int k = 1; k < kFirstFunctions; ++k)
        if (signs >> (k - 1) & 1) matrix.col(k) *= -1;
    }
  map_from(candidates, known);
}

/// Maps candidates[begin] and those after it. One that has a map already is refined from it.
void MapSearch::map_from(std::vector<Candidate>& candidates, size_t begin) const {
  pool_.run(static_cast<int>(candidates.size() - begin), [&](int i) {
    Candidate& candidate = candidates[begin + size_t(i)];
    candidate.by_map = begin > 0 || candidate.mirrored;
    map_candidate(candidate, kRoughSamples, kRoughStep);
  });
}

std::vector<Candidate> MapSearch::finely_mapped(const std::vector<Candidate>& candidates,
                                                const std::vector<size_t>& chosen) const {
  std::vector<Candidate> ordered;
  ordered.reserve(chosen.size());
  for (const size_t i : chosen) ordered.push_back(candidates[i]);
  std::vector<Candidate> mapped = distinct(ordered, kMaxFinelyMapped);
  pool_.run(static_cast<int>(mapped.size()),
            [&](int i) { map_candidate(mapped[size_t(i)], source_.samples.size(), kFineStep); });
  const auto first_astray =
      std::stable_partition(mapped.begin(), mapped.end(),
                            [&](const Candidate& one) { return keeps_markers(one.target_of); });
  if (first_astray != mapped.begin()) mapped.erase(first_astray, mapped.end());
  return mapped;
}

/// Up to `most` candidates from the first on, each with a map that differs from those before it.
std::vector<Candidate> MapSearch::distinct(const std::vector<Candidate>& ordered,
                                           size_t most) const {
  std::vector<Candidate> chosen;
  for (const Candidate& candidate : ordered) {
    const bool known = std::any_of(chosen.begin(), chosen.end(), [&](const Candidate& other) {
      return mean_distance(candidate.target_of, other.target_of) < kSameMapDistance;
    });
    if (!known && chosen.size() < most) chosen.push_back(candidate);
  }
  return chosen;
}

void MapSearch::map_candidate(Candidate& candidate, size_t samples, int step) const {
  find_map(candidate, samples, step);
  candidate.target_of = roughly_nearest(candidate.map);
  candidate.orientation = kept_orientation(candidate.target_of);
  candidate.as_they_stand = keeps_stance(candidate.target_of);
  if (candidate.by_map) candidate.similarity = fitted(candidate.target_of);
}

void MapSearch::find_map(Candidate& candidate, size_t samples, int step) const {
  const Positions source_samples = candidate.placed_samples(source_, samples);
  const Positions target_samples = rows_of(target_.mesh.positions, target_.samples, samples);
  SampledFunctions sampled = {rows_of(bases_[0].functions, source_.samples, samples),
                              rows_of(bases_[1].functions, target_.samples, samples),
                              {}};
  for (const auto& [of_source, of_target] : marked_)
    sampled.landmarks.push_back(
        {bases_[0].functions.row(of_source), bases_[1].functions.row(of_target)});
  const NearestRows rows = candidate.map.size() == 0
                               ? nearest_rows(source_samples, target_samples)
                               : nearest_rows(candidate.map(sampled.source),
                                              sampled.target.leftCols(candidate.map.size()));
  candidate.map = zoomed_out(sampled, rows, kFirstFunctions, count_, step);
  candidate.stretch = stretch_of(candidate.map, bases_[0].values, bases_[1].values);
}

NearestRows MapSearch::nearest(const FunctionalMap& map) const {
  return nearest_rows(map(bases_[0].functions), bases_[1].functions);
}

/// For each source vertex the target vertex with the nearest values of the eigenfunctions among
/// kRoughSamples samples.
std::vector<int> MapSearch::roughly_nearest(const FunctionalMap& map) const {
  std::vector<int> target_of =
      nearest_rows(map(bases_[0].functions),
                   rows_of(bases_[1].functions, target_.samples, kRoughSamples))
          .of_first;
  for (int& row : target_of) row = target_.samples[size_t(row)];
  return target_of;
}

double MapSearch::mean_distance(const std::vector<int>& one, const std::vector<int>& other) const {
  double sum = 0;
  for (size_t i = 0; i < one.size(); ++i)
    sum += (target_.mesh.positions.row(one[i]) - target_.mesh.positions.row(other[i])).norm();
  return sum / static_cast<double>(one.size());
}

bool MapSearch::keeps_markers(const std::vector<int>& target_of) const {
  return std::all_of(marked_.begin(), marked_.end(), [&](const std::array<int, 2>& pair) {
    return (target_.mesh.positions.row(target_of[size_t(pair[0])]) -
            target_.mesh.positions.row(pair[1]))
               .norm() < kElsewhereDistance / 2;
  });
}

Similarity MapSearch::fitted(const std::vector<int>& target_of) const {
  Positions images(source_.mesh.vertex_count(), 3);
  for (Index v = 0; v < images.rows(); ++v)
    images.row(v) = target_.mesh.positions.row(target_of[size_t(v)]);
  return fitted_similarity(source_.mesh.positions, images, Eigen::VectorXd::Ones(images.rows()));
}

/// Whether the similarity fitted to a map turns the source by less than 45°.
bool MapSearch::keeps_stance(const std::vector<int>& target_of) const {
  return fitted(target_of).rotation.trace() > 1 + 2 * std::sqrt(0.5);
}

double MapSearch::kept_orientation(const std::vector<int>& target_of) const {
  double sum = 0;
  for (int j = 0; j < source_.mesh.triangle_count(); ++j) {
    Eigen::Matrix3d corners;
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();
    for (int k = 0; k < 3; ++k) {
      const int v = target_of[size_t(source_.mesh.triangles(j, k))];
      corners.col(k) = target_.mesh.positions.row(v).transpose();
      normal += target_.normals.row(v).transpose().normalized();
    }
    const double side =
        normal.dot(edges_and_normal(corners.col(0), corners.col(1), corners.col(2)).col(2));
    if (side != 0) sum += side > 0 ? source_.areas[j] : -source_.areas[j];
  }
  return sum / source_.areas.sum();
}

}  // namespace dd
