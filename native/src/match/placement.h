// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <vector>

#include "match/coarse_shape.h"
#include "support/similarity.h"
#include "support/thread_pool.h"

namespace dd {

constexpr double kExact = 0.005;        // of misfits and stretches: less is no difference
constexpr double kElsewhere = 0.2;      // of the box: farther apart on average are other places
constexpr double kAsTheyStand = 0.8;    // of the misfit of others: users' meshes mostly stand alike
constexpr double kNearlyAsWell = 1.15;  // of the misfit

/// One way to put a source on a target.
struct Placement {
  Similarity similarity;
  bool mirrored = false;  ///< beforehand, in x
  bool as_they_stand = false;
  double misfit = 0;  ///< of the box: distances of nearest points, both ways, and of markers

  /// The misfit, less where it is as they stand: the least is preferred.
  double preferred() const;
  /// Whether it fits about as well as the best.
  bool fits_about_as(const Placement& best) const;
  /// The first count of the source's samples, placed.
  Positions samples(const CoarseShape& source, size_t count) const;
};

/// Places of markers in both shapes' boxes, k×3 each.
struct MarkedPlaces {
  Positions source, target;

  /// Whether a similarity follows from them: three, not on a line.
  bool suffice() const;
};

/// By markers that suffice.
Placement placement_by(const MarkedPlaces& marked, const CoarseShape& source,
                       const CoarseShape& target);

/// What fits best of: as they stand (the first), the rotations that take axes to axes, and those
/// that take principal axes to principal axes, each also with the source's mirror image, which is
/// another way for left to come to lie on the right. Each is followed by nearest points, both ways
/// (Besl and McKay 1992), with the markers that there are.
std::vector<Placement> placements(const CoarseShape& source, const CoarseShape& target,
                                  const MarkedPlaces& marked, ThreadPool& pool);

/// Finds its misfit without markers.
void measure_by_shape(Placement& placement, const CoarseShape& source, const CoarseShape& target);

/// How a source lies on a target.
struct Lying {
  Similarity similarity;
  bool ambiguous = false;  ///< turned otherwise, it does, too
};

/// Where the surfaces lie on one another but for parts that one of them lacks, as a head and a
/// remesh of it without the insides of mouth and eyes: followed from each of the starts by nearest
/// points, which pull the less the farther they are. None where not half of each comes close to the
/// other. Of several the one whose start fits best by all. Not mirrored.
std::optional<Lying> lying_on(const std::vector<Placement>& starts, const CoarseShape& source,
                              const CoarseShape& target, const MarkedPlaces& marked,
                              ThreadPool& pool);

/// Whether one of the surfaces is open and lies on the other as they stand, as a part that was cut
/// off does; a closed one may be akin and have no more than its trunk in common. stance: of the
/// source to the target.
bool stands_on(const CoarseShape& source, const CoarseShape& target, const MarkedPlaces& marked,
               const Similarity& stance);

}  // namespace dd
