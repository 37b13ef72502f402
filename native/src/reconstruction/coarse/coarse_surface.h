// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "reconstruction/coarse/coarse_mesh.h"
#include "reconstruction/factored_surface.h"

namespace dd {

/// A coarse version of the active part of a surface, for fields that vary slowly. Its vertices are
/// some of the surface's: all constrained ones of that part, next to which it is as fine as the
/// surface, and some of the free ones.
class CoarseSurface {
 public:
  /// Null where too many free vertices would remain to save time, or the coarse system is singular.
  /// spacing: of the free vertices that are kept, in the mesh's units. growth: see CoarseMesh.
  static std::unique_ptr<CoarseSurface> make(const FactoredSurface& fine, double spacing,
                                             double growth = kUsualGrowth);

  FactoredSurface& surface() { return *surface_; }
  const FactoredSurface& surface() const { return *surface_; }
  /// Its vertices, as vertices of the fine surface.
  const std::vector<int>& vertices() const { return contraction_->vertices; }

  /// How it was made of the fine surface's faces.
  const CoarseMesh& contraction() const { return *contraction_; }

  /// Its triangles, and where it ends those of the fine surface, of fine vertices.
  Triangles with_surroundings(const FactoredSurface& fine) const;

  /// Selects the coarse surface's rows from rows in the fine surface's order.
  void restrict(const Rows& fine, Rows& coarse) const;

  /// Interpolation of a value at an active vertex of the fine surface: three active indices of the
  /// coarse surface with barycentric weights, some of which may be 0.
  struct Stencil {
    std::array<int, 3> active_index;
    std::array<double, 3> weight;
  };
  std::vector<Stencil> stencils(const FactoredSurface& fine) const;

  double bytes() const;

 private:
  CoarseSurface() = default;

  Region region_;
  std::unique_ptr<FactoredSurface> surface_;
  std::shared_ptr<const CoarseMesh> contraction_;  // of the fine surface
  std::vector<int> fine_row_;                      // row in the fine surface's order of each row
};

}  // namespace dd
