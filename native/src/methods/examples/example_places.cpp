// SPDX-License-Identifier: GPL-3.0-or-later
#include "methods/examples/example_places.h"

namespace dd {

ExamplePlaces::ExamplePlaces(const BoundSurface& bound, const Region& region,
                             const RowOrder& order) {
  if (region.grounds.empty()) return;
  const Triangles& t = bound.mesh.triangles;
  std::vector<double> area(region.role.size(), 0);
  for (Index j = 0; j < t.rows(); ++j)
    for (int k = 0; k < 3; ++k) area[t(j, k)] += bound.operators.metric.areas[j] / 3;

  const Components components = connected_components(bound.mesh);
  std::vector<int> part_of(static_cast<size_t>(components.count), -1);
  for (int v : region.grounds) {
    part_of[components.of_vertex[v]] = static_cast<int>(parts_.size());
    parts_.emplace_back();
  }
  for (int r = 0; r < order.free_count; ++r) {
    const int v = order.vertex_of_row[r], part = part_of[components.of_vertex[v]];
    if (part < 0) continue;
    parts_[part].rows.push_back(r);
    parts_[part].areas.push_back(area[v]);
  }
  for (Part& part : parts_) {
    double whole = 0;
    for (double a : part.areas) whole += a;
    part.shifts = Positions::Zero(static_cast<Index>(bound.examples.size()), 3);
    for (size_t k = 0; k < part.rows.size(); ++k) {
      part.areas[k] /= whole;
      const int v = order.vertex_of_row[part.rows[k]];
      for (Index i = 0; i < part.shifts.rows(); ++i)
        part.shifts.row(i) +=
            part.areas[k] * (bound.examples[i].row(v) - bound.mesh.positions.row(v));
    }
  }
}

void ExamplePlaces::settle(const Eigen::VectorXd& weights, Rows& offsets) const {
  for (const Part& part : parts_) {
    Eigen::RowVector3d missing = weights.transpose() * part.shifts;
    for (size_t k = 0; k < part.rows.size(); ++k)
      missing -= part.areas[k] * offsets.row(part.rows[k]).head<3>();
    for (int r : part.rows) offsets.row(r).head<3>() += missing;
  }
}

}  // namespace dd
