// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mesh/correspondence.h"
#include "support/similarity.h"
#include "transfer/coarse_shape.h"

namespace dd {

/// Where limbs end: vertices that are farther from the surface as a whole, over it and on average,
/// than all about them. The farthest first, a few at most. mesh: in one part.
std::vector<int> limb_tips(const Mesh& mesh, const std::vector<int>& samples);

/// Pairs of tips of either shape that correspond, as many as the one with fewer has; none where
/// these and what is marked are fewer than four, or where more than forty are marked. By how far
/// they are apart over the surfaces, beside the farthest of each, which limbs that are longer
/// change little, by how a similarity fits them, which tells left from right, and by how near the
/// placement takes them, in boxes of size 1.
/// marked: pairs of vertices that correspond; tips next to these are left out.
Pairs paired_tips(const CoarseShape& source, const CoarseShape& target, const Similarity& placement,
                  const Pairs& marked);

}  // namespace dd
