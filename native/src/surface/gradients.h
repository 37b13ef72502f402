// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "kernels/kernels.h"
#include "surface/poisson_system.h"

namespace dd {

/// For each triangle of the base the one whose motion from B to B' gives its S_j (15): itself, or,
/// where it has no area to speak of and (15) has no inverse, the nearest triangle across shared
/// edges, or else vertices, that has. -1 where a whole part has none: its S_j is the identity.
///
/// "No area": longest edge under 1e-9 of size, or height over it under 1e-2 of it: a
/// flatter one turns the rounding of B into a rotation. Chosen over
/// clamping because a neighbour's S_j is still exact for rigid and affine motions of the base.
/// size: of the surface S, whose base may have collapsed. moved: where given, a source has an area
/// there as well, in the same measure.
struct GradientSources {
  std::vector<int> of_triangle;
  int borrowed_count = 0;
};
GradientSources gradient_sources(const Positions& base, const Triangles& triangles, double size,
                                 const Positions* moved = nullptr);

/// Gives each triangle whose source is -1 that of the nearest triangle with one across shared
/// edges, or else vertices, unless its whole part has none.
void fill_from_neighbours(std::vector<int>& source_of, const Triangles& triangles);

/// The edges e1, e2 from the triangle's first corner and its unit normal, as columns: those of
/// (15). The normal is zero where there is no area.
Eigen::Matrix3d edges_and_normal(const Positions& positions, const Triangles& triangles,
                                 Index triangle);

/// A triangle at rest as the passes take it: see TriangleShape, and its frame's axes e1/|e1|,
/// n × e1/|e1|, n as columns.
struct RestFrame {
  RestFrame(const Positions& positions, const Triangles& triangles, Index triangle);
  double inverse_length, shear, inverse_height;
  Eigen::Matrix3d axes;
};

/// The given triangles, at rest, for Kernels::rotation_pass: padded to whole blocks by ones that
/// don't turn, as those without a source.
template <class Real>
std::vector<RotationBlock<Real>> rotation_blocks(const Positions& rest, const Triangles& triangles,
                                                 const std::vector<int>& which,
                                                 const GradientSources& sources,
                                                 const RowOrder& order);

/// Blocks of kLanes active triangles, whole ones for each part.
struct ActiveBlocks {
  explicit ActiveBlocks(const ActiveTriangles& active);
  ActiveBlocks() = default;
  int count() const { return begin.empty() ? 0 : begin.back(); }
  int parts() const { return static_cast<int>(begin.size()) - 1; }
  /// Calls body(place in active, part, block, lane) for each active triangle.
  template <class Body>
  void each(const ActiveTriangles& active, const Body& body) const {
    for (int part = 0; part < parts(); ++part)
      for (int i = active.begin[part]; i < active.begin[part + 1]; ++i) {
        const int k = i - active.begin[part];
        body(i, part, begin[part] + k / kLanes, k % kLanes);
      }
  }
  /// As many blocks, all of whose targets nobody reads.
  template <class Block>
  std::vector<Block> without_targets(const PoissonSystem& poisson) const {
    std::vector<Block> blocks(static_cast<size_t>(count()));
    for (int part = 0; part < parts(); ++part)
      for (int b = begin[part]; b < begin[part + 1]; ++b)
        for (auto& corner : blocks[b].target)
          for (int32_t& row : corner) row = poisson.spare_target(part);
    return blocks;
  }
  std::vector<int> begin;  ///< first block of each part, and the end
};

/// A pass over triangles that turns base positions into the right-hand side div(S_jᵀ) of (14).
template <class Real>
class GradientPass {
 public:
  /// base: B at rest, n×3. corner_flux: corner_divergence() of S, 3m×3. Active triangles without a
  /// source are left out.
  GradientPass(const Positions& base, const Triangles& triangles, const Positions& corner_flux,
               const GradientSources& sources, const PoissonSystem& poisson);

  /// Adds S_j · flux of each triangle's corners, those of one part. base: rows of 4 doubles in the
  /// order of the system, right_hand_side: as in PoissonSystem::solve().
  void add(int part, const double* base, bool rotation_only, double* right_hand_side) const {
    const int begin = layout_.begin[part];
    kernels().of<Real>().gradient_pass(layout_.begin[part + 1] - begin, blocks_.data() + begin,
                                       base, rotation_only, right_hand_side);
  }

  double bytes() const { return static_cast<double>(blocks_.size() * sizeof(TriangleBlock<Real>)); }

 private:
  ActiveBlocks layout_;
  std::vector<TriangleBlock<Real>> blocks_;
};

}  // namespace dd
