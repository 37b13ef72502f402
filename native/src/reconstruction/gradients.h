// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "kernels/kernels.h"
#include "reconstruction/factored_surface.h"

namespace dd {

/// For each triangle of a surface its stand-in, the triangle whose motion gives its deformation
/// gradient (15). A triangle with area stands in for itself. For one without, (15) has no inverse;
/// its stand-in is the nearest triangle with area, across shared edges first and then across
/// vertices. -1: no triangle of the component has area.
///
/// A triangle has no area if its longest edge is at most 1e-9 of size, or if its height is both at
/// most 1e-2 of that edge and at most 1e-5 of size: there rounding of positions becomes a rotation.
/// A higher needle keeps its own gradient, so that a mesh of needles alone bends. A neighbour's
/// gradient, unlike a clamped one, is exact for rigid and affine motions.
struct StandIns {
  std::vector<int> of_triangle;
};

/// surface: positions of the surface or its base. size: the box's diagonal of S, since the base may
/// have collapsed. moved: null, or positions in which a stand-in must have area too, by the same
/// thresholds.
StandIns stand_ins(const Positions& surface, const Triangles& triangles, double size,
                   const Positions* moved = nullptr);

/// A triangle at rest for the kernels: the entries of TriangleShape, and its frame e1/|e1|,
/// n × e1/|e1|, n as columns.
struct RestFrame {
  RestFrame(const Positions& positions, const Triangles& triangles, Index triangle);
  double inverse_length, shear, inverse_height;
  Eigen::Matrix3d axes;
};

/// Input of KernelsOf::rotation_pass() for the given triangles, at rest. Triangles without a
/// stand-in, and lanes that pad the last block, have no area, so that the pass returns zeros for
/// them.
template <class Real>
std::vector<RotationBlock<Real>> rotation_blocks(const Positions& rest, const Triangles& triangles,
                                                 const std::vector<int>& which,
                                                 const StandIns& stand_ins, const RowOrder& order);

/// The layout of active triangles in blocks of kLanes; each section begins with a new block.
struct ActiveBlocks {
  explicit ActiveBlocks(const ActiveTriangles& active);
  ActiveBlocks() = default;
  int count() const { return begin.empty() ? 0 : begin.back(); }
  int sections() const { return static_cast<int>(begin.size()) - 1; }
  /// Calls body(index in active, section, block, lane) for each active triangle, for those of
  /// several sections at a time. pool: null, or for this call.
  template <class Body>
  void each(const ActiveTriangles& active, const Body& body, ThreadPool* pool = nullptr) const {
    run_tasks(pool, sections(), [&](int section) {
      for (int i = active.begin[section]; i < active.begin[section + 1]; ++i) {
        const int k = i - active.begin[section];
        body(i, section, begin[section] + k / kLanes, k % kLanes);
      }
    });
  }
  /// count() blocks in which the target of every corner is the discard row of its section. The
  /// caller sets the targets of the lanes that have a triangle; the rows to which the unused lanes
  /// add are never read.
  template <class Block>
  std::vector<Block> discarding_blocks(const PoissonSystem& poisson) const {
    std::vector<Block> blocks(static_cast<size_t>(count()));
    for (int section = 0; section < sections(); ++section)
      for (int b = begin[section]; b < begin[section + 1]; ++b)
        for (auto& corner : blocks[b].target)
          for (int32_t& row : corner) row = poisson.discard_row(section);
    return blocks;
  }
  std::vector<int> begin;  ///< first block of each section, and the end
};

/// Sets the flux of blocks in this layout to the corner_divergence() of positions (n×3) by the
/// metric of the surface.
template <class Real>
void take_flux(const FactoredSurface& surface, const ActiveBlocks& layout, const Positions& of,
               std::vector<RotatedFluxBlock<Real>>& blocks) {
  const ActiveTriangles& active = surface.poisson->active();
  const auto take = [&](int i, int, int b, int lane) {
    const Eigen::Matrix3d flux = corner_divergences(
        surface.operators.metric, of, surface.operators.triangles, active.triangles[i]);
    for (int k = 0; k < 2; ++k)
      for (int c = 0; c < 3; ++c) blocks[b].flux[k][c][lane] = static_cast<Real>(flux(c, k));
  };
  layout.each(active, take, &surface.poisson->pool());
}

/// Input of KernelsOf::rotated_flux_pass() for the active triangles, with the flux of positions
/// (n×3) by the metric of the surface. corner_of(vertex): its row of the quaternions.
template <class Real, class CornerOf>
std::vector<RotatedFluxBlock<Real>> rotated_flux_blocks(const FactoredSurface& surface,
                                                        const ActiveBlocks& layout,
                                                        const Positions& of,
                                                        const CornerOf& corner_of) {
  const PoissonSystem& poisson = *surface.poisson;
  const Triangles& t = surface.operators.triangles;
  auto blocks = layout.discarding_blocks<RotatedFluxBlock<Real>>(poisson);
  const auto place = [&](int i, int section, int b, int lane) {
    RotatedFluxBlock<Real>& block = blocks[b];
    const int j = poisson.active().triangles[i];
    for (int k = 0; k < 3; ++k) {
      block.corner[k][lane] = corner_of(t(j, k));
      block.target[k][lane] = poisson.right_hand_side_row(section, t(j, k));
    }
  };
  layout.each(poisson.active(), place, &poisson.pool());
  take_flux(surface, layout, of, blocks);
  return blocks;
}

/// Computes the right-hand side div(S_jᵀ) of (14) from base positions, block by block.
template <class Real>
class GradientPass {
 public:
  /// base: B at rest, n×3. Active triangles without a stand-in are left out.
  GradientPass(const FactoredSurface& surface, const Positions& base, const StandIns& stand_ins);

  /// Adds S_j · flux at the corners of the triangles of a section. base: rows of 4 doubles in the
  /// system's order. right_hand_side: as in PoissonSystem::solve().
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
