// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mesh/mesh.h"
#include "support/thread_pool.h"

namespace dd {

/// How high a target is over the vertices of a surface that deforms, each under the point of the
/// target that it was under at rest: what rises between a garment's vertices is seen by this.
class Probes {
 public:
  /// Vertices of the surface that are under the target, or over it, within reach.
  Probes(const Mesh& surface, const Mesh& target, double reach, ThreadPool& pool);

  /// Takes the surface's positions in a pose.
  void take(const Positions& posed);

  int count() const { return static_cast<int>(probes_.size()); }
  double height(int probe, const Positions& target) const;
  /// The surface's normal there.
  Eigen::Vector3d direction(int probe) const { return normals_.row(probes_[probe].vertex); }

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
    int vertex, triangle;  // of the surface and of the target
    Eigen::Vector3d weights;
  };
  Triangles surface_, target_;
  std::vector<Probe> probes_;
  std::vector<int> begin_;  // of each vertex of the target
  std::vector<Part> parts_;
  Positions posed_, normals_;
};

}  // namespace dd
