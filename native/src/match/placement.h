// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <vector>

#include "match/coarse_shape.h"
#include "support/similarity.h"
#include "support/thread_pool.h"

namespace dd {

// Added to misfits, which are fractions of the diagonal of the target's box, and to stretches
// before they are compared by their ratio or product: differences much smaller than this don't
// decide.
constexpr double kScoreOffset = 0.005;
// Mean distance above which two placements take points elsewhere, as a fraction of the diagonal of
// the target's box; a marker may miss its partner by half of it.
constexpr double kElsewhereDistance = 0.2;
// Factor on the misfit of a placement that turns the source little or not at all: users' meshes
// mostly stand alike, so such a placement is preferred to one that fits slightly better.
constexpr double kAsTheyStandFactor = 0.8;
// Ratio of misfits up to which two placements fit about as well.
constexpr double kAmbiguousMisfitRatio = 1.15;

/// A candidate placement of a source on a target, between their unit boxes.
struct Placement {
  Similarity similarity;
  bool mirrored = false;  ///< the source is reflected in x beforehand
  /// Whether it was begun without a rotation or, where it was fitted to a functional map, turns the
  /// source by less than 45°.
  bool as_they_stand = false;
  /// In the target's unit box: the sum of the RMS distances of closest points of source and target,
  /// and of markers.
  double misfit = 0;

  /// The misfit, reduced if as_they_stand; the placement with the least is preferred.
  double preferred() const;
  /// Whether it fits about as well as the best.
  bool fits_about_as(const Placement& best) const;
  /// The positions of the first count of CoarseShape::samples, placed.
  Positions placed_samples(const CoarseShape& source, size_t count) const;
};

/// Positions of markers in both shapes' unit boxes, k×3 each.
struct MarkerPositions {
  Positions source, target;

  /// Whether they determine a similarity: at least three that aren't collinear.
  bool suffice() const;
};

/// The placement by markers that suffice(); if they are few, refined by closest points.
Placement placement_by(const MarkerPositions& marked, const CoarseShape& source,
                       const CoarseShape& target);

/// Distinct candidates of the least misfits; the first one begins without a rotation. The others
/// begin with the rotations that take axes to axes, or principal axes to principal axes, of the
/// source and of its mirror image, which may swap left and right. All are refined by iterated
/// closest points in both directions (Besl and McKay 1992), with the given markers.
std::vector<Placement> placement_candidates(const CoarseShape& source, const CoarseShape& target,
                                            const MarkerPositions& marked, ThreadPool& pool);

/// Sets the placement's misfit to that without markers.
void remeasure_without_markers(Placement& placement, const CoarseShape& source,
                               const CoarseShape& target);

/// A similarity that lays a source on a target, except for parts that one of them lacks.
struct PartialFit {
  Similarity similarity;
  bool ambiguous = false;  ///< another one, clearly different, does so about as well
};

/// The similarity that lays the surfaces on each other except for parts that one of them lacks, as
/// a remesh of a head lacks the insides of mouth and eyes. Each start is refined by closest points
/// whose weights fall with distance. None if less than half of either surface comes close to the
/// other, or if the markers are missed. Of several, the one with the preferred() start. Never
/// mirrored.
std::optional<PartialFit> fit_partially(const std::vector<Placement>& starts,
                                        const CoarseShape& source, const CoarseShape& target,
                                        const MarkerPositions& marked, ThreadPool& pool);

/// Whether a placement lays an open surface on the other one, as a part that was cut off. A closed
/// surface doesn't count: it may be a related shape of which only the trunk coincides. placement:
/// takes the source to the target, between their unit boxes.
bool part_lies_on_whole(const CoarseShape& source, const CoarseShape& target,
                        const MarkerPositions& marked, const Similarity& stance);

}  // namespace dd
