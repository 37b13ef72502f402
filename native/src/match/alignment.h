// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <vector>

#include "mesh/correspondence.h"
#include "support/progress.h"
#include "support/similarity.h"

namespace dd {

/// A coarse alignment of a source with a target: the start of a registration.
struct Alignment {
  Similarity placement;                  ///< takes the source onto the target
  std::optional<Similarity> by_markers;  ///< the same, fitted to three or more markers
  /// The functional map between the coarse shapes. For each source vertex: the source vertex that
  /// represents it in the coarse shape, and the target vertex that corresponds to that one; −1 if
  /// none represents it. Empty if the shapes are too small or not connected, or if the map's
  /// stretch is too large to guide a registration.
  std::vector<int> representative, map_target;
  /// Probably corresponding ends of limbs, vertices of the source and the target; only if the map's
  /// stretch is too large and lies_on is false.
  Pairs tips;
  /// The placement lays the surfaces on each other, except for parts that one of them lacks or that
  /// are posed differently.
  bool lies_on = false;
  /// Another placement or map fits about as well and takes points elsewhere.
  bool ambiguous = false;
};

/// The markers sorted, without duplicates. Throws Error(argument) if a vertex is out of range, or
/// if a source vertex has two partners.
Pairs checked_markers(Pairs markers, const Mesh& source, const Mesh& target);

/// Whether the markers say that the target is the source's mirror image, which takes four that
/// aren't coplanar. Throws as checked_markers().
bool marked_as_mirror_image(const Mesh& source, const Mesh& target, const Pairs& markers);

/// Aligns the source with the target:
///   1. Candidate placements are the markers' own, if three aren't collinear, and those of
///      placement_candidates() with and without the markers. Without functional maps, the former is
///      the only one if it exists.
///   2. From each candidate a functional map is grown (zoomed_out()), which tolerates poses, at
///      first from few samples. Maps with other signs of the first eigenfunctions join in, as a map
///      may swap left and right. The most promising distinct maps are grown from all samples.
///   3. Maps that turn the surface inside out are dropped, and those that miss the markers if any
///      map keeps them. Of the rest, the one with the least product of misfit and stretch wins.
///   4. Unless its stretch is convincing, its placement is replaced by one that lays the surfaces
///      on each other except for parts that one of them lacks, if there is one: fit_partially(), or
///      else part_lies_on_whole() as the meshes are, or with given_placement unless that is
///      mirrored.
/// The placement is never mirrored: mirror the source of a mirror image first.
Alignment align(const Mesh& source, const Mesh& target, const Pairs& markers, int threads = 0,
                const Progress& progress = {}, const Similarity* given_placement = nullptr);

}  // namespace dd
