// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <utility>
#include <vector>

#include "match/coarse_shape.h"
#include "match/functional_map.h"
#include "match/placement.h"
#include "match/spectral_basis.h"
#include "mesh/correspondence.h"
#include "support/progress.h"
#include "support/thread_pool.h"

namespace dd {

/// Largest stretch (stretch_of()) of a map that is believed: 0 is that of an isometry. Then neither
/// maps with other signs nor PartialFit are tried.
constexpr double kConvincingStretch = 0.07;

/// A candidate placement with its functional map.
struct Candidate : Placement {
  explicit Candidate(const Placement& placement) : Placement(placement) {}

  FunctionalMap map;
  std::vector<int> target_of;  ///< for each source vertex, one of some samples of the target
  bool by_map = false;         ///< whether the similarity is fitted to the map
  double stretch = 0;          ///< of the map: stretch_of()
  /// In [−1, 1]: the source's area whose image keeps its orientation less that whose image is
  /// turned over, as a fraction of the whole.
  double orientation = 0;

  /// Both are smallest for the best candidate. preferred() also favours a map that leaves the
  /// source as it stands; it decides, while score() only orders what is to be tried.
  double score() const { return (misfit + kScoreOffset) * (stretch + kScoreOffset); }
  double preferred() const { return Placement::preferred() * (stretch + kScoreOffset); }
};

/// Grows functional maps from candidate placements (zoomed_out()).
class MapSearch {
 public:
  /// marked: pairs of vertices of the coarse shapes, from the markers. The shapes and the pool must
  /// outlive this.
  MapSearch(const CoarseShape& source, const CoarseShape& target, Pairs marked, ThreadPool& pool)
      : source_(source), target_(target), marked_(std::move(marked)), pool_(pool) {}

  /// Computes the eigenfunctions of both shapes. Returns false if a shape isn't connected or has
  /// too few vertices; then there are no maps.
  bool compute_bases(const Progress& progress);

  /// Maps the candidates from few samples, and appends maps with other signs of the first
  /// eigenfunctions unless the best map is convincing.
  void search_maps(std::vector<Candidate>& candidates, const Progress& progress);

  /// The first distinct ones of the candidates, mapped anew from all samples: maps from few samples
  /// only tell which are much worse. If any of these maps keeps the markers, only those that do.
  /// chosen: indices of candidates, the best first.
  std::vector<Candidate> finely_mapped(const std::vector<Candidate>& candidates,
                                       const std::vector<size_t>& chosen) const;

  /// The corresponding vertex of each vertex of both shapes.
  NearestRows nearest(const FunctionalMap& map) const;
  /// Mean distance between the images of the source's vertices by two maps, in the target's box.
  double mean_distance(const std::vector<int>& one, const std::vector<int>& other) const;
  /// Whether a map takes each marker to within kElsewhereDistance / 2 of its partner.
  bool keeps_markers(const std::vector<int>& target_of) const;

 private:
  void map_from(std::vector<Candidate>& candidates, size_t begin) const;
  void map_candidate(Candidate& candidate, size_t samples, int step) const;
  void find_map(Candidate& candidate, size_t samples, int step) const;
  std::vector<Candidate> distinct(const std::vector<Candidate>& ordered, size_t most) const;
  std::vector<int> roughly_nearest(const FunctionalMap& map) const;
  Similarity fitted(const std::vector<int>& target_of) const;
  bool keeps_stance(const std::vector<int>& target_of) const;
  double kept_orientation(const std::vector<int>& target_of) const;

  const CoarseShape &source_, &target_;
  Pairs marked_;
  ThreadPool& pool_;
  SpectralBasis bases_[2];
  int count_ = 0;  // of eigenfunctions
};

}  // namespace dd
