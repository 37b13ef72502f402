// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mesh/mesh.h"
#include "mesh/unit_box.h"
#include "reconstruction/components.h"
#include "solver/sparse_cholesky.h"
#include "support/similarity.h"
#include "support/thread_pool.h"

namespace dd {

class SourceGradients;
class SourcePoints;

/// What the corrections of a transfer have in common. All that is pointed to must outlive them.
struct TransferContext {
  const Mesh* source = nullptr;
  const Mesh* target = nullptr;
  const UnitBox* box = nullptr;           ///< of the target
  const Similarity* placement = nullptr;  ///< takes the source onto the target
  const SourceGradients* gradients = nullptr;
  /// Of the target, with those of their triangles that have a source.
  const std::vector<Component>* components = nullptr;
  const SourcePoints* points =
      nullptr;  ///< of the target's vertices; null if no correction needs them
  Precision precision = Precision::full;  ///< of the factors that a pose uses
  ThreadPool* pool = nullptr;
};

}  // namespace dd
