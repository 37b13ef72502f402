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
  /// For each target triangle, in [0, 1]: 1 if a source triangle coincides with it, with the same
  /// normal, and has its own closest point there; 0 if it has no source.
  std::vector<float> confidence;
};

/// Pairs each triangle of either mesh with the other mesh's triangle closest to its centre, of
/// those with a normal less than 90° off. registered: the source at the positions of
/// register_onto(). reach: the largest distance, as a fraction of the diagonal of the target's box.
Match match_triangles(const Mesh& registered, const Mesh& target, double reach, int threads = 0,
                      const Progress& progress = {});

/// Lowers the confidence of triangles whose sources the registration stretched or compressed,
/// relative to the source as a whole: to half at a factor of three. A leg on a tail, or a face on a
/// cat, lies as close and as parallel there as where it belongs.
void doubt_stretched(Match& match, const Mesh& source, const Positions& registered);

/// The mean of the confidence, weighted by the target's areas; 0 for a target without area.
double mean_confidence(const Match& match, const Mesh& target);

}  // namespace dd
