// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mesh/correspondence.h"
#include "mesh/mesh.h"
#include "support/progress.h"

namespace dd {

/// Corresponding triangles of a registered source and a target.
struct Match {
  Correspondence correspondence;
  /// Of each target triangle, 0 to 1: 1 where a triangle lies on it in parallel and belongs to it,
  /// 0 where none does.
  std::vector<float> confidence;
};

/// For each triangle of either mesh the one of the other whose surface is nearest to its centre and
/// whose normal is less than a right angle off. registered: the source's triangles with the
/// positions that register_onto() gave.
Match match_triangles(const Mesh& registered, const Mesh& target, double reach, int threads = 0,
                      const Progress& progress = {});

/// Lowers the confidence where the sources of a triangle were pulled to several times their length
/// on the way to it, or squeezed to a part of it, beside the whole: half is left at three times. A
/// leg on a tail, or a face on a cat, lies there as close and as parallel as where it belongs.
void doubt_stretched(Match& match, const Mesh& source, const Positions& registered);

/// The mean of the confidence over the target's area, 0 for a target without any.
double mean_confidence(const Match& match, const Mesh& target);

}  // namespace dd
