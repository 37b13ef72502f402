// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <vector>

#include "mesh/correspondence.h"
#include "support/progress.h"
#include "support/similarity.h"

namespace dd {

/// How a source lies on a target, roughly: where a registration begins.
struct Alignment {
  Similarity placement;                  ///< of the source onto the target
  std::optional<Similarity> by_markers;  ///< the same by three markers or more and little else
  /// For each vertex of the source the one that stands for it, as coarsely as the surfaces were
  /// looked at, and the vertex of the target that corresponds to that; empty where they are too
  /// small or too ragged for a map, or that means little, −1 where there is none.
  std::vector<int> centre, partner;
  /// Where the map means little: vertices at the ends of limbs that probably correspond.
  Pairs tips;
  /// So the surfaces lie on one another, except for what one of them lacks, or what is posed.
  bool lies_on = false;
  /// Another placement fits about as well, and takes places elsewhere.
  bool ambiguous = false;
};

/// Markers, sorted and each once. Throws Error(argument) where they are out of range or
/// contradictory.
Pairs checked_markers(Pairs markers, const Mesh& source, const Mesh& target);

/// Whether by the markers the target is the source's mirror image, which takes four that are not in
/// a plane. Throws as checked_markers().
bool marked_as_mirror_image(const Mesh& source, const Mesh& target, const Pairs& markers);

/// Placed by the markers where there are three not on a line, and by placements(), with the markers
/// and without; where the surfaces are too small or ragged for a map, by the markers alone. From
/// each of these, functions of the surfaces, smooth ones first, give a map that copes with poses
/// (zoomed_out()), at first of few samples, and so do maps that take left and right otherwise; the
/// most promising that differ are mapped by all. The one is taken that keeps lengths best and lies
/// nearest and doesn't turn the surface inside out, of those that keep the markers where any does.
/// Unless that convinces, lying_on() has the last word, then stands_on(), as their positions have
/// it or by a given stance of the source, of which a reflection isn't looked at. Never mirrored:
/// what are mirror images is mirrored first.
Alignment align(const Mesh& source, const Mesh& target, const Pairs& markers, int threads = 0,
                const Progress& progress = {}, const Similarity* stance = nullptr);

}  // namespace dd
