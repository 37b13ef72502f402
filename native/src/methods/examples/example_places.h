// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "methods/examples/example_surface.h"

namespace dd {

/// Places components without constrained vertices in a pose of examples. Gradients leave their
/// translation open; it is chosen so that the component's area-weighted centroid is
///
///   c' = c + Σ_i w_i (c_i − c),   c_i the centroid in example i
class ExamplePlaces {
 public:
  /// region, order: of the system that is solved. Without region.grounds there are no such
  /// components.
  ExamplePlaces(const ExampleSurface& of, const Region& region, const RowOrder& order);

  /// offsets: the displacement of S in that order; each such component is translated.
  void place(const Eigen::VectorXd& weights, Rows& offsets) const;

 private:
  struct FloatingComponent {
    std::vector<int> rows;
    std::vector<double> areas;  // of each row's vertex, normalized to sum 1
    Positions shifts;           // c_i − c, a row for each example
  };
  std::vector<FloatingComponent> components_;
};

}  // namespace dd
