// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "wear/far_sides.h"

namespace dd {

/// Heights of a target over vertices of a deforming surface, each over the same point of the target
/// as at rest. They show where the surface rises between a garment's vertices.
class Probes {
 public:
  /// Probes are the vertices of the surface with a closest point of the target within reach, in
  /// about the direction of their normal or against it. surface: at rest; outlives this. tree: over
  /// it.
  Probes(const PosedSurface& surface, const AabbTree& tree, const Mesh& target, double reach,
         ThreadPool& pool);

  /// Updates the directions; to be called when the surface has taken a pose.
  void look(ThreadPool& pool);

  int count() const { return static_cast<int>(probes_.size()); }
  double height(int probe, const Positions& target) const;
  /// The surface's unit normal at a probe's vertex.
  Eigen::Vector3d direction(int probe) const { return directions_.row(probe).transpose(); }
  /// See FarSides::outwardness().
  double outwardness(int probe) const { return far_sides_->outwardness(probe, about(probe)); }

  /// The shift of a target vertex that, with those of its triangle's other corners, raises the
  /// target by 1 over a probe. Of least norm: λ_k / Σ λ², λ the barycentric weights.
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
  std::vector<int> begin_;  // parts of target vertex v: begin_[v] to begin_[v + 1]
  std::vector<Part> parts_;
  Positions directions_;
  std::unique_ptr<FarSides> far_sides_;
};

}  // namespace dd
