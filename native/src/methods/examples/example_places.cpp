// SPDX-License-Identifier: GPL-3.0-or-later
#include "methods/examples/example_places.h"

#include <utility>

#include "reconstruction/components.h"

namespace dd {

ExamplePlaces::ExamplePlaces(const ExampleSurface& of, const Region& region,
                             const RowOrder& order) {
  if (region.grounds.empty()) return;
  const Triangles& t = of.surface.operators.triangles;
  std::vector<double> vertex_areas(region.role.size(), 0);
  for (Index j = 0; j < t.rows(); ++j)
    for (int k = 0; k < 3; ++k) vertex_areas[t(j, k)] += of.surface.operators.metric.areas[j] / 3;

  for (const Component& mesh_component : movable_components(of.surface.mesh, region)) {
    if (mesh_component.held) continue;
    FloatingComponent component;
    for (int v : mesh_component.vertices) {
      component.rows.push_back(order.row_of_vertex[v]);
      component.areas.push_back(vertex_areas[v]);
    }
    double total_area = 0;
    for (double a : component.areas) total_area += a;
    component.shifts = Positions::Zero(static_cast<Index>(of.examples.size()), 3);
    for (size_t k = 0; k < component.rows.size(); ++k) {
      component.areas[k] /= total_area;
      const int v = order.vertex_of_row[component.rows[k]];
      for (Index i = 0; i < component.shifts.rows(); ++i)
        component.shifts.row(i) +=
            component.areas[k] * (of.examples[size_t(i)].row(v) - of.surface.mesh.positions.row(v));
    }
    components_.push_back(std::move(component));
  }
}

void ExamplePlaces::place(const Eigen::VectorXd& weights, Rows& offsets) const {
  for (const FloatingComponent& component : components_) {
    Eigen::RowVector3d missing = weights.transpose() * component.shifts;
    for (size_t k = 0; k < component.rows.size(); ++k)
      missing -= component.areas[k] * offsets.row(component.rows[k]).head<3>();
    for (int r : component.rows) offsets.row(r).head<3>() += missing;
  }
}

}  // namespace dd
