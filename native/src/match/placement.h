// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <vector>

#include "match/coarse_shape.h"
#include "support/similarity.h"
#include "support/thread_pool.h"

namespace dd {

// Added to misfits and stretches before they are compared: smaller differences don't decide.
constexpr double kExact = 0.005;
// Mean distance above which two placements take points elsewhere, as a fraction of the diagonal of
// the target's box; a marker may miss its partner by half of it.
constexpr double kElsewhere = 0.2;
// Factor on the misfit of a placement that leaves the source as it stands: users' meshes mostly
// have the same stance.
constexpr double kAsTheyStand = 0.8;
// Ratio of misfits up to which two placements fit about as well.
constexpr double kNearlyAsWell = 1.15;

/// A candidate placement of a source on a target, between their unit boxes.
struct Placement {
  Similarity similarity;
  bool mirrored = false;  ///< the source is reflected in x beforehand
  bool as_they_stand = false;
  /// In the target's unit box: the sum of the RMS distances of closest points of source and target,
  /// and of markers.
  double misfit = 0;

  /// The misfit, reduced if the source is as it stands; the placement of the least is preferred.
  double preferred() const;
  /// Whether it fits about as well as the best.
  bool fits_about_as(const Placement& best) const;
  /// The first count of the source's samples, placed.
  Positions samples(const CoarseShape& source, size_t count) const;
};

/// Positions of markers in both shapes' unit boxes, k×3 each.
struct MarkedPlaces {
  Positions source, target;

  /// Whether they determine a similarity: at least three that aren't collinear.
  bool suffice() const;
};

/// The placement by markers that suffice(); if they are few, refined by closest points.
Placement placement_by(const MarkedPlaces& marked, const CoarseShape& source,
                       const CoarseShape& target);

/// Distinct candidates of the least misfits; the first one begins without a rotation. The others
/// begin with the rotations that take axes to axes, or principal axes to principal axes, of the
/// source and of its mirror image, which may swap left and right. All are refined by iterated
/// closest points in both directions (Besl and McKay 1992), with the given markers.
std::vector<Placement> placements(const CoarseShape& source, const CoarseShape& target,
                                  const MarkedPlaces& marked, ThreadPool& pool);

/// Sets the placement's misfit to that without markers.
void measure_by_shape(Placement& placement, const CoarseShape& source, const CoarseShape& target);

/// A similarity that lays a source on a target.
struct Lying {
  Similarity similarity;
  bool ambiguous = false;  ///< another one, clearly different, does so about as well
};

/// The similarity that lays the surfaces on each other except for parts that one of them lacks, as
/// a remesh of a head lacks the insides of mouth and eyes. Each start is refined by closest points
/// whose weights fall with distance. None if less than half of either surface comes close to the
/// other, or if the markers are missed. Of several, the one with the preferred() start. Never
/// mirrored.
std::optional<Lying> lying_on(const std::vector<Placement>& starts, const CoarseShape& source,
                              const CoarseShape& target, const MarkedPlaces& marked,
                              ThreadPool& pool);

/// Whether an open surface lies on the other one, as a part that was cut off does. A closed surface
/// doesn't count: it may be a related shape of which only the trunk coincides. stance: takes the
/// source to the target.
bool stands_on(const CoarseShape& source, const CoarseShape& target, const MarkedPlaces& marked,
               const Similarity& stance);

}  // namespace dd
