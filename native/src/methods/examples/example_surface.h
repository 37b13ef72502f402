// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <utility>
#include <vector>

#include "methods/examples/example_logarithms.h"

namespace dd {

/// A surface with its examples and their rotations: S, or a coarse surface in its place.
struct ExampleSurface {
  /// given_surface must outlive this. given_examples: poses of its vertices, n×3 each.
  ExampleSurface(const FactoredSurface& given_surface, std::vector<Positions> given_examples)
      : surface(given_surface),
        examples(std::move(given_examples)),
        logarithms(surface, examples) {}

  double bytes() const {
    return logarithms.bytes() + static_cast<double>(examples.size() * sizeof(double)) *
                                    static_cast<double>(surface.mesh.positions.size());
  }

  const FactoredSurface& surface;
  std::vector<Positions> examples;
  ExampleLogarithms logarithms;
};

}  // namespace dd
