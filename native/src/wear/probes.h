// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "wear/far_sides.h"

namespace dd {

/// Heights of a target, such as a garment, over vertices of a deforming surface: the probes. Each
/// is measured at the point of the target that was closest to the probe at rest. So probes find
/// where the surface comes through a triangle of the target whose corners are all outside.
class Probes {
 public:
  /// Probes are the vertices of the surface with a closest point of the target within reach, in
  /// about the direction of their normal or against it. surface: at rest; outlives this. tree: over
  /// it.
  Probes(const PosedSurface& surface, const AabbTree& tree, const Mesh& target, double reach,
         ThreadPool& pool);

  /// Updates the directions; to be called when the surface's pose was set.
  void update_directions(ThreadPool& pool);

  int count() const { return static_cast<int>(probes_.size()); }
  double height(int probe, const Positions& target) const;
  /// The surface's unit normal at a probe's vertex.
  Eigen::Vector3d direction(int probe) const { return directions_.row(probe).transpose(); }
  /// See FarSides::outwardness().
  double outwardness(int probe) const { return far_sides_->outwardness(probe, point_patch(probe)); }

  /// What a probe asks of one corner of the target's triangle over it: the corner's shift along the
  /// probe's direction that, together with those of the other two corners, raises the target by 1
  /// over the probe. Of all such shifts those with the least sum of squares, λ_k / Σ λ², λ the
  /// barycentric weights of the point over the probe.
  struct CornerShift {
    int probe;
    double shift;
  };
  struct CornerShifts {
    const CornerShift *first, *last;
    const CornerShift* begin() const { return first; }
    const CornerShift* end() const { return last; }
  };
  CornerShifts of(int target_vertex) const {
    return {corner_shifts_.data() + corner_shift_begin_[size_t(target_vertex)],
            corner_shifts_.data() + corner_shift_begin_[size_t(target_vertex) + 1]};
  }

 private:
  struct Probe {
    int vertex;            // of the surface
    PointOnTriangle over;  // of the target
  };
  FarSides::PointPatch point_patch(int probe) const {
    const int vertex = probes_[size_t(probe)].vertex;
    return {surface_.mesh().positions.row(vertex), surface_.patch(surface_.fan(vertex))};
  }

  const PosedSurface& surface_;
  Triangles target_;
  std::vector<Probe> probes_;
  std::vector<int> corner_shift_begin_;  // of each target vertex, in corner_shifts_
  std::vector<CornerShift> corner_shifts_;
  Positions directions_;
  std::unique_ptr<FarSides> far_sides_;
};

}  // namespace dd
