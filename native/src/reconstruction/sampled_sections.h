// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "reconstruction/free_lengths.h"
#include "reconstruction/samples_of_vertices.h"
#include "reconstruction/section_rays.h"

namespace dd {

/// By sample.
struct SampledSections {
  Positions axes;  ///< unit vectors along the limb
  std::vector<SectionSample> sections;
};

/// Casts rays from all samples, or on a coarse surface, for a quarter of the rays, from those of a
/// maximal independent set. The others get what its nearest vertex beside them met, with means of
/// the centres and shares of those beside them; sections vary slowly along a limb.
SampledSections sample_sections(const CrossSectionSamples& samples, const SectionRays& rays,
                                const SamplesOfVertices& of_vertices, const FreeLengths& free);

}  // namespace dd
