// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mesh/topology.h"
#include "reconstruction/factored_surface.h"

namespace dd {

/// What is asked of all of a surface where only a part of it is bound (MeshPart).
struct WholeSurface {
  Components components;         ///< of the part's vertices, connected by the whole's triangles
  std::vector<double> outwards;  ///< by component, see outward_signs()
  double area = 0;               ///< of all triangles
  double mean_edge_length = 0;   ///< over all triangles
};

/// By component: 1, or -1 where the triangles of a closed one face inwards, so that its volume is
/// negative; the volume of an open one is that of the cone over it.
std::vector<double> outward_signs(const Mesh& mesh, const Components& components);

// Of a surface, or of the one that it is a part of.
Components components_of(const FactoredSurface& surface);
std::vector<double> outward_signs(const FactoredSurface& surface, const Components& components);
double whole_area(const FactoredSurface& surface);
double whole_mean_edge_length(const FactoredSurface& surface);

}  // namespace dd
