// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <utility>
#include <vector>

#include "methods/examples/example_turns.h"

namespace dd {

/// A surface with its examples and their rotations: S, or a coarse surface in its place.
struct ExampleSurface {
  /// its_surface must outlive this. its_examples: poses of its vertices, n×3 each.
  ExampleSurface(const FactoredSurface& its_surface, std::vector<Positions> its_examples)
      : surface(its_surface), examples(std::move(its_examples)), turns(surface, examples) {}

  double bytes() const {
    return turns.bytes() + static_cast<double>(examples.size() * sizeof(double)) *
                               static_cast<double>(surface.mesh.positions.size());
  }

  const FactoredSurface& surface;
  std::vector<Positions> examples;
  ExampleTurns turns;
};

}  // namespace dd
