// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "methods/examples/example_surface.h"

namespace dd {

/// Components that nothing holds, posed by weights. Gradients leave their translation open; it is
/// chosen so that the component's area-weighted centre goes where the examples take it,
///
///   c' = c + Σ_i w_i (c_i − c)
class ExamplePlaces {
 public:
  /// region, order: of the system that is solved; grounds tell the components.
  ExamplePlaces(const ExampleSurface& of, const Region& region, const RowOrder& order);

  /// offsets: the displacement of S in that order, shifted as a whole in each such component.
  void place(const Eigen::VectorXd& weights, Rows& offsets) const;

 private:
  struct Placed {
    std::vector<int> rows;
    std::vector<double> areas;  // of each row's vertex, as parts of 1
    Positions shifts;           // c_i − c, by example
  };
  std::vector<Placed> components_;
};

}  // namespace dd
