// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "deform/deformer.h"

namespace dd {

/// A preview during a bind that takes long: some ten thousand of the surface's vertices, bound as a
/// mesh of their own, carry the others as a base of another topology does (see BaseProxy). It is
/// made in a fraction of the time, and takes the same poses and options. Handles are met exactly,
/// rest is reproduced; elsewhere it differs from the surface's own result by about as much as a
/// mesh of another density does.
class Draft {
 public:
  /// mesh, roles and options: as the Deformer's. Null where the coarse mesh is not small enough to
  /// save time, and with a base from outside. Throws Error.
  static std::unique_ptr<Draft> make(const Mesh& mesh, const std::vector<int>& roles,
                                     int handle_count, const BindOptions& options);

  /// The displacement of every vertex, n×3, in the mesh's units; valid until the next call. Throws
  /// Error(argument) for MethodKind::examples.
  const Positions& update(const double* matrices, UpdateOptions options);

  const Positions& rest() const { return rest_; }
  /// The bound coarse mesh, by which update options are checked.
  const Deformer& coarse() const { return *coarse_; }

 private:
  Draft(const Mesh& mesh, Region region, int threads);

  ThreadPool pool_;
  Positions rest_;
  Region region_;
  UnitBox box_;
  Positions centres_;      // of the handles
  Positions coarse_rest_;  // in the box
  std::unique_ptr<Deformer> coarse_;
  std::unique_ptr<BaseProxy> carrier_;  // of the free vertices: by the coarse mesh
  Positions offsets_;
};

}  // namespace dd
