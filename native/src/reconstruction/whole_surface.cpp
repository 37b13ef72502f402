// SPDX-License-Identifier: GPL-3.0-or-later
#include "reconstruction/whole_surface.h"

#include <Eigen/Geometry>

#include "mesh/triangles.h"

namespace dd {

std::vector<double> outward_signs(const Mesh& mesh, const Components& components) {
  std::vector<double> volumes(size_t(components.count), 0.0);
  std::vector<int> apex(size_t(components.count), -1);
  for (Index j = 0; j < mesh.triangles.rows(); ++j) {
    const auto corner = mesh.triangles.row(j);
    const auto component = size_t(components.of_vertex[size_t(corner[0])]);
    if (apex[component] < 0) apex[component] = corner[0];
    const auto from_apex = [&](int k) -> Eigen::Vector3d {
      return (mesh.positions.row(corner[k]) - mesh.positions.row(apex[component])).transpose();
    };
    volumes[component] += from_apex(0).dot(from_apex(1).cross(from_apex(2)));
  }
  for (double& volume : volumes) volume = volume < 0 ? -1 : 1;
  return volumes;
}

Components components_of(const FactoredSurface& surface) {
  return surface.whole ? surface.whole->components
                       : Components(surface.mesh.triangles, surface.mesh.vertex_count());
}

std::vector<double> outward_signs(const FactoredSurface& surface, const Components& components) {
  return surface.whole ? surface.whole->outwards : outward_signs(surface.mesh, components);
}

double whole_area(const FactoredSurface& surface) {
  return surface.whole ? surface.whole->area
                       : triangle_areas(surface.mesh.positions, surface.mesh.triangles).sum();
}

double whole_mean_edge_length(const FactoredSurface& surface) {
  return surface.whole ? surface.whole->mean_edge_length
                       : mean_edge_length(surface.mesh.positions, surface.mesh.triangles);
}

}  // namespace dd
