// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "reconstruction/factored_surface.h"

namespace dd {

/// The active part of a surface with fewer vertices, which are some of its own: for fields that
/// vary slowly. Constrained vertices are all there, and towards them it is as fine as the surface.
class CoarseSurface {
 public:
  /// Null where there would be little less to do. spacing: of the vertices that are left, in the
  /// mesh's units.
  static std::unique_ptr<CoarseSurface> make(const FactoredSurface& fine, double spacing);

  FactoredSurface& surface() { return *surface_; }
  const FactoredSurface& surface() const { return *surface_; }
  /// The fine surface's vertices that its own are.
  const std::vector<int>& vertices() const { return vertex_; }

  /// Those of the given rows of the fine surface's order that are the coarse one's, in its order.
  void restrict(const Rows& fine, Rows& coarse) const;

  /// For an active vertex of the fine surface, by its place among these, what it takes of the
  /// coarse one's, by theirs: weights in a triangle, some may be 0.
  struct Share {
    std::array<int, 3> place;
    std::array<double, 3> weight;
  };
  std::vector<Share> shares(const FactoredSurface& fine) const;

  double bytes() const;

 private:
  CoarseSurface() = default;

  Region region_;
  std::unique_ptr<FactoredSurface> surface_;
  std::vector<int> vertex_, of_vertex_;  // of the fine surface; for each of its vertices
  std::vector<int> fine_row_;            // of each row
};

}  // namespace dd
