// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "match/coarse_shape.h"
#include "mesh/correspondence.h"
#include "support/similarity.h"

namespace dd {

/// The ends of limbs: vertices whose mean geodesic distance to samples of the whole surface is the
/// largest within a neighbourhood, and at least 1.25 times that of the innermost vertex. At most
/// eight, the largest first. mesh: connected.
std::vector<int> limb_tips(const Mesh& mesh, const std::vector<int>& samples);

/// Pairs of corresponding tips, as many as the shape with fewer tips has. Of all pairings the one
/// of least cost, the sum of three terms. Marked pairs count in the first two like pairs of tips:
///   1. the mean over any two pairs of the difference of the logarithms of their geodesic distances
///      on either shape, as fractions of the largest one, so that longer limbs cost little;
///   2. the mean over all pairs of the residual of the similarity that fits them best, which tells
///      left from right;
///   3. the mean over pairs of tips alone of the distance between partners after the placement.
/// Lengths in 2 and 3 are in boxes of diagonal 1. None where tips and markers together are fewer
/// than four pairs, or where more than forty pairs are marked. marked: pairs of vertices known to
/// correspond; tips beside these are left out.
Pairs paired_tips(const CoarseShape& source, const CoarseShape& target, const Similarity& placement,
                  const Pairs& marked);

}  // namespace dd
