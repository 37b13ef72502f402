// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "kernels/kernels.h"
#include "reconstruction/factored_surface.h"

namespace dd {

/// Says for each triangle of a surface which triangle stands in for it: whose motion gives its
/// deformation gradient (15). A triangle with an area stands in for itself. One without has no
/// inverse in (15), and the nearest triangle that has an area stands in for it, across shared edges
/// first and then across vertices. -1 says that no triangle of the component has an area.
///
/// A triangle counts as one without area when its longest edge is under 1e-9 of size, or its height
/// under 1e-2 of that edge and 1e-5 of size: there rounding turns into a rotation. A needle that is
/// higher has its own gradient, so that a mesh of nothing but needles bends. A neighbour's gradient
/// was chosen over a clamped one because it is exact for rigid and affine motions.
struct StandIns {
  std::vector<int> of_triangle;
};

/// size: of the surface S, whose base may have collapsed. moved: where given, what stands in has an
/// area there as well, in the same measure.
StandIns stand_ins(const Positions& surface, const Triangles& triangles, double size,
                   const Positions* moved = nullptr);

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
                                                 const StandIns& stand_ins, const RowOrder& order);

/// Blocks of kLanes active triangles, whole ones for each section.
struct ActiveBlocks {
  explicit ActiveBlocks(const ActiveTriangles& active);
  ActiveBlocks() = default;
  int count() const { return begin.empty() ? 0 : begin.back(); }
  int sections() const { return static_cast<int>(begin.size()) - 1; }
  /// Calls body(place in active, section, block, lane) for each active triangle.
  template <class Body>
  void each(const ActiveTriangles& active, const Body& body) const {
    for (int section = 0; section < sections(); ++section)
      for (int i = active.begin[section]; i < active.begin[section + 1]; ++i) {
        const int k = i - active.begin[section];
        body(i, section, begin[section] + k / kLanes, k % kLanes);
      }
  }
  /// As many blocks, all of whose targets nobody reads.
  template <class Block>
  std::vector<Block> without_targets(const PoissonSystem& poisson) const {
    std::vector<Block> blocks(static_cast<size_t>(count()));
    for (int section = 0; section < sections(); ++section)
      for (int b = begin[section]; b < begin[section + 1]; ++b)
        for (auto& corner : blocks[b].target)
          for (int32_t& row : corner) row = poisson.spare_target(section);
    return blocks;
  }
  std::vector<int> begin;  ///< first block of each section, and the end
};

/// Gives such blocks the flux of positions (n×3) by the metric of the surface.
template <class Real>
void take_flux(const FactoredSurface& surface, const ActiveBlocks& layout, const Positions& of,
               std::vector<TurnBlock<Real>>& blocks) {
  const Positions flux =
      corner_divergence(surface.operators.metric, of, surface.operators.triangles);
  const ActiveTriangles& active = surface.poisson->active();
  layout.each(active, [&](int i, int, int b, int lane) {
    for (int k = 0; k < 2; ++k)
      for (int c = 0; c < 3; ++c)
        blocks[b].flux[k][c][lane] = static_cast<Real>(flux(3 * Index(active.triangles[i]) + k, c));
  });
}

/// The active triangles for Kernels::turn_pass, with the flux of the positions of (n×3) by the
/// metric of the surface. corner_of(vertex): its row of the quaternions.
template <class Real, class CornerOf>
std::vector<TurnBlock<Real>> turn_blocks(const FactoredSurface& surface, const ActiveBlocks& layout,
                                         const Positions& of, const CornerOf& corner_of) {
  const PoissonSystem& poisson = *surface.poisson;
  const Triangles& t = surface.operators.triangles;
  auto blocks = layout.without_targets<TurnBlock<Real>>(poisson);
  layout.each(poisson.active(), [&](int i, int section, int b, int lane) {
    TurnBlock<Real>& block = blocks[b];
    const int j = poisson.active().triangles[i];
    for (int k = 0; k < 3; ++k) {
      block.corner[k][lane] = corner_of(t(j, k));
      block.target[k][lane] = poisson.target(section, t(j, k));
    }
  });
  take_flux(surface, layout, of, blocks);
  return blocks;
}

/// A pass over triangles that turns base positions into the right-hand side div(S_jᵀ) of (14).
template <class Real>
class GradientPass {
 public:
  /// base: B at rest, n×3. Active triangles that nothing stands in for are left out.
  GradientPass(const FactoredSurface& surface, const Positions& base, const StandIns& stand_ins);

  /// Adds S_j · flux of each triangle's corners, those of one section. base: rows of 4 doubles in
  /// the order of the system, right_hand_side: as in PoissonSystem::solve().
  void add(int section, const double* base, bool rotation_only, double* right_hand_side) const {
    const int begin = layout_.begin[section];
    kernels().of<Real>().gradient_pass(layout_.begin[section + 1] - begin, blocks_.data() + begin,
                                       base, rotation_only, right_hand_side);
  }

  double bytes() const { return static_cast<double>(blocks_.size() * sizeof(TriangleBlock<Real>)); }

 private:
  ActiveBlocks layout_;
  std::vector<TriangleBlock<Real>> blocks_;
};

}  // namespace dd
