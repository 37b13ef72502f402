// SPDX-License-Identifier: GPL-3.0-or-later
#include "reconstruction/components.h"

#include "mesh/topology.h"

namespace dd {

std::vector<Component> movable_components(const Mesh& mesh, const Region& region) {
  const Components all(mesh.triangles, mesh.vertex_count());
  std::vector<int> number(static_cast<size_t>(all.count), -1);
  std::vector<Component> found;
  for (int v = 0; v < mesh.vertex_count(); ++v) {
    if (region.role[v] == kFixed) continue;
    int& component = number[all.of_vertex[v]];
    if (component < 0) {
      component = static_cast<int>(found.size());
      found.emplace_back();
    }
    found[component].vertices.push_back(v);
  }
  for (int v = 0; v < mesh.vertex_count(); ++v) {
    const int component = number[all.of_vertex[v]];
    if (component >= 0 && region.role[v] != kFree) found[component].held = true;
  }
  for (int j = 0; j < mesh.triangle_count(); ++j) {
    const int component = number[all.of_vertex[mesh.triangles(j, 0)]];
    if (component >= 0) found[component].triangles.push_back(j);
  }
  return found;
}

}  // namespace dd
