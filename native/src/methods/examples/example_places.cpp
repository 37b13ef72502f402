// SPDX-License-Identifier: GPL-3.0-or-later
#include "methods/examples/example_places.h"

#include <utility>

#include "reconstruction/components.h"

namespace dd {

ExamplePlaces::ExamplePlaces(const ExampleSurface& of, const Region& region,
                             const RowOrder& order) {
  if (region.grounds.empty()) return;
  const Triangles& t = of.surface.operators.triangles;
  std::vector<double> area(region.role.size(), 0);
  for (Index j = 0; j < t.rows(); ++j)
    for (int k = 0; k < 3; ++k) area[t(j, k)] += of.surface.operators.metric.areas[j] / 3;

  for (const Component& component : movable_components(of.surface.mesh, region)) {
    if (component.held) continue;
    Placed placed;
    for (int v : component.vertices) {
      placed.rows.push_back(order.row_of_vertex[v]);
      placed.areas.push_back(area[v]);
    }
    double whole = 0;
    for (double a : placed.areas) whole += a;
    placed.shifts = Positions::Zero(static_cast<Index>(of.examples.size()), 3);
    for (size_t k = 0; k < placed.rows.size(); ++k) {
      placed.areas[k] /= whole;
      const int v = order.vertex_of_row[placed.rows[k]];
      for (Index i = 0; i < placed.shifts.rows(); ++i)
        placed.shifts.row(i) +=
            placed.areas[k] * (of.examples[size_t(i)].row(v) - of.surface.mesh.positions.row(v));
    }
    components_.push_back(std::move(placed));
  }
}

void ExamplePlaces::place(const Eigen::VectorXd& weights, Rows& offsets) const {
  for (const Placed& placed : components_) {
    Eigen::RowVector3d missing = weights.transpose() * placed.shifts;
    for (size_t k = 0; k < placed.rows.size(); ++k)
      missing -= placed.areas[k] * offsets.row(placed.rows[k]).head<3>();
    for (int r : placed.rows) offsets.row(r).head<3>() += missing;
  }
}

}  // namespace dd
