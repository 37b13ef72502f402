// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "wear/far_sides.h"

namespace dd {

/// How high a target is over the vertices of a surface that deforms, each under the point of the
/// target that it was under at rest: what rises between a garment's vertices is seen by this.
class Probes {
 public:
  /// Vertices of the surface that are under the target, or over it, within reach. surface: at
  /// rest; outlives this. tree: over it.
  Probes(const PosedSurface& surface, const AabbTree& tree, const Mesh& target, double reach,
         ThreadPool& pool);

  /// To be called when the surface has taken a pose.
  void look(ThreadPool& pool);

  int count() const { return static_cast<int>(probes_.size()); }
  double height(int probe, const Positions& target) const;
  /// The surface's normal there.
  Eigen::Vector3d direction(int probe) const { return directions_.row(probe).transpose(); }
  /// How much the surface still faces outwards there.
  double outwardness(int probe) const { return far_sides_->outwardness(probe, about(probe)); }

  /// The least shifts of the target's vertices that raise it by 1 over a probe: so far each of
  /// them.
  struct Part {
    int probe;
    double shift;
  };
  struct Parts {
    const Part *first, *last;
    const Part* begin() const { return first; }
    const Part* end() const { return last; }
  };
  Parts of(int target_vertex) const {
    return {parts_.data() + begin_[size_t(target_vertex)],
            parts_.data() + begin_[size_t(target_vertex) + 1]};
  }

 private:
  struct Probe {
    int vertex;            // of the surface
    PointOnTriangle over;  // of the target
  };
  FarSides::About about(int probe) const {
    const int vertex = probes_[size_t(probe)].vertex;
    return {surface_.mesh().positions.row(vertex), surface_.patch(surface_.fan(vertex))};
  }

  const PosedSurface& surface_;
  Triangles target_;
  std::vector<Probe> probes_;
  std::vector<int> begin_;  // of each vertex of the target
  std::vector<Part> parts_;
  Positions directions_;
  std::unique_ptr<FarSides> far_sides_;
};

}  // namespace dd
