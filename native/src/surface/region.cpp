// SPDX-License-Identifier: GPL-3.0-or-later
#include "surface/region.h"

#include <string>

#include "support/error.h"

namespace dd {

namespace {

void check_roles(const Mesh& mesh, const std::vector<int>& roles, int handle_count,
                 MovedBy moved_by) {
  if (handle_count < (moved_by == MovedBy::base ? 0 : 1))
    throw Error(Status::region, "There is no handle: add at least one that moves some vertices.");
  if (handle_count > mesh.vertex_count())
    throw Error(Status::region, "There are more handles than vertices.");
  std::vector<char> used(static_cast<size_t>(handle_count), 0);
  bool any_free = false;
  for (int v = 0; v < mesh.vertex_count(); ++v) {
    const int role = roles[v];
    if (role < kFixed || role >= handle_count)
      throw Error(Status::region, "Vertex " + std::to_string(v) + " has the role " +
                                      std::to_string(role) + ", which is no handle.");
    if (role >= 0) used[role] = 1;
    any_free |= role == kFree;
  }
  for (int h = 0; h < handle_count; ++h) {
    if (!used[h])
      throw Error(Status::region,
                  "Handle " + std::to_string(h) + " has no vertices: give it at least one.");
  }
  if (!any_free)
    throw Error(Status::region,
                "No vertex is free to follow: every vertex is fixed or in a handle. Enlarge the "
                "region or shrink the handles.");
}

}  // namespace

Region split_region(const Mesh& mesh, const std::vector<int>& roles, int handle_count,
                    MovedBy moved_by) {
  check_roles(mesh, roles, handle_count, moved_by);
  const int n = mesh.vertex_count();

  std::vector<char> has_triangle(static_cast<size_t>(n), 0);
  for (Index k = 0; k < mesh.triangles.size(); ++k) has_triangle[mesh.triangles.data()[k]] = 1;
  const Components parts = connected_components(mesh);
  std::vector<char> part_moves(static_cast<size_t>(parts.count), moved_by == MovedBy::base);
  std::vector<char> part_is_held(static_cast<size_t>(parts.count), 0);
  for (int v = 0; v < n; ++v) {
    if (roles[v] >= 0) part_moves[parts.of_vertex[v]] = 1;
    if (roles[v] != kFree) part_is_held[parts.of_vertex[v]] = 1;
  }

  Region region;
  region.role = roles;
  region.row.assign(static_cast<size_t>(n), -1);
  region.handle_count = handle_count;
  std::vector<char> part_rests(static_cast<size_t>(parts.count), 0);
  for (int v = 0; v < n; ++v) {
    int& role = region.role[v];
    if (role == kFree && !has_triangle[v]) {
      role = kFixed;
      if (region.loose_count++ == 0) region.loose_example = v;
    } else if (role == kFree && !part_moves[parts.of_vertex[v]]) {
      role = kFixed;
      if (region.resting_count++ == 0) region.resting_example = v;
      char& rests = part_rests[parts.of_vertex[v]];
      region.resting_part_count += !rests;
      rests = 1;
    }
    if (role == kFree) {
      char& held = part_is_held[parts.of_vertex[v]];
      if (!held) region.grounds.push_back(v);
      held = 1;
      region.row[v] = region.free_count();
      region.free.push_back(v);
    } else if (role >= 0) {
      region.handle_vertices.push_back(v);
    }
  }
  if (region.free.empty())
    throw Error(
        Status::region,
        "No handle can move any vertex of the region: the handles are on other loose parts "
        "of the mesh than the region (vertex " +
            std::to_string(region.resting_count ? region.resting_example : region.loose_example) +
            ", for one). Put a handle on the part that should deform.");

  std::vector<char> pulls(static_cast<size_t>(handle_count), 0);
  for (Index j = 0; j < mesh.triangles.rows(); ++j) {
    const auto corners = mesh.triangles.row(j);
    const bool follows = (region.role[corners[0]] == kFree) || (region.role[corners[1]] == kFree) ||
                         (region.role[corners[2]] == kFree);
    for (const int v : corners)
      if (follows && region.role[v] >= 0) pulls[region.role[v]] = 1;
  }
  for (int h = 0; h < handle_count; ++h)
    if (!pulls[h]) region.idle_handles.push_back(h);
  return region;
}

}  // namespace dd
