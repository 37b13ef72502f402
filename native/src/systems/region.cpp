// SPDX-License-Identifier: GPL-3.0-or-later
#include "systems/region.h"

#include <algorithm>
#include <string>
#include <utility>

#include "mesh/topology.h"
#include "support/error.h"

namespace dd {

namespace {

void check_coverage(const std::vector<int>& roles, int handle_count, MovedBy moved_by) {
  if (handle_count < (moved_by == MovedBy::base ? 0 : 1))
    throw Error(Status::region, "There is no handle", Remedy::add_handle);
  check_roles(roles, handle_count);
  if (std::find(roles.begin(), roles.end(), kFree) == roles.end())
    throw Error(Status::region, "No vertex is free to follow, every one is fixed or in a handle",
                Remedy::free_vertices);
}

/// Handles none of whose vertices shares a triangle with a free vertex.
std::vector<int> idle_handles(const Mesh& mesh, const Region& region) {
  std::vector<char> has_free_neighbour(static_cast<size_t>(region.handle_count), 0);
  for (Index j = 0; j < mesh.triangles.rows(); ++j) {
    const auto corners = mesh.triangles.row(j);
    const bool has_free = (region.role[corners[0]] == kFree) ||
                          (region.role[corners[1]] == kFree) || (region.role[corners[2]] == kFree);
    for (const int v : corners)
      if (has_free && region.role[v] >= 0) has_free_neighbour[region.role[v]] = 1;
  }
  std::vector<int> idle;
  for (int h = 0; h < region.handle_count; ++h)
    if (!has_free_neighbour[h]) idle.push_back(h);
  return idle;
}

}  // namespace

void check_roles(const std::vector<int>& roles, int handle_count) {
  if (handle_count > static_cast<int>(roles.size()))
    throw Error(Status::region, "There are more handles than vertices", Remedy::call);
  std::vector<char> used(static_cast<size_t>(handle_count), 0);
  for (size_t v = 0; v < roles.size(); ++v) {
    if (roles[v] < kFixed || roles[v] >= handle_count)
      throw Error(Status::region, {Subject::vertex, Index(v)},
                  "has the role " + std::to_string(roles[v]) + ", which is no handle",
                  Remedy::call);
    if (roles[v] >= 0) used[roles[v]] = 1;
  }
  const auto unused = std::find(used.begin(), used.end(), 0);
  if (unused != used.end())
    throw Error(Status::region, {Subject::handle, unused - used.begin()}, "has no vertices",
                Remedy::assign_vertices);
}

std::vector<int> triangles_with_free_corners(const Region& region, const Triangles& triangles) {
  std::vector<int> found;
  for (int j = 0; j < static_cast<int>(triangles.rows()); ++j) {
    const auto corners = triangles.row(j);
    if (std::any_of(corners.begin(), corners.end(), [&](int v) { return region.row[v] >= 0; }))
      found.push_back(j);
  }
  return found;
}

Region region_of_roles(std::vector<int> roles, int handle_count) {
  Region region;
  region.role = std::move(roles);
  region.handle_count = handle_count;
  region.row.assign(region.role.size(), -1);
  for (size_t v = 0; v < region.role.size(); ++v) {
    if (region.role[v] == kFree) {
      region.row[v] = region.free_count();
      region.free.push_back(static_cast<int>(v));
    } else if (region.role[v] >= 0) {
      region.handle_vertices.push_back(static_cast<int>(v));
    }
  }
  return region;
}

Region make_region(const Mesh& mesh, const std::vector<int>& roles, int handle_count,
                   MovedBy moved_by) {
  check_coverage(roles, handle_count, moved_by);
  const int n = mesh.vertex_count();

  std::vector<char> has_triangle(static_cast<size_t>(n), 0);
  for (Index k = 0; k < mesh.triangles.size(); ++k) has_triangle[mesh.triangles.data()[k]] = 1;
  const Components parts(mesh.triangles, mesh.vertex_count());
  std::vector<char> part_moves(static_cast<size_t>(parts.count), moved_by == MovedBy::base);
  std::vector<char> part_is_held(static_cast<size_t>(parts.count), 0);
  for (int v = 0; v < n; ++v) {
    if (roles[v] >= 0) part_moves[parts.of_vertex[v]] = 1;
    if (roles[v] != kFree) part_is_held[parts.of_vertex[v]] = 1;
  }

  std::vector<int> kept = roles;
  std::vector<int> resting, isolated;
  int resting_component_count = 0;
  std::vector<char> part_rests(static_cast<size_t>(parts.count), 0);
  for (int v = 0; v < n; ++v) {
    if (kept[v] != kFree || (has_triangle[v] && part_moves[parts.of_vertex[v]])) continue;
    kept[v] = kFixed;
    if (!has_triangle[v]) {
      isolated.push_back(v);
      continue;
    }
    resting.push_back(v);
    char& rests = part_rests[parts.of_vertex[v]];
    resting_component_count += !rests;
    rests = 1;
  }

  Region region = region_of_roles(std::move(kept), handle_count);
  if (region.free.empty()) {
    std::vector<int>& unreached = resting.empty() ? isolated : resting;
    const int first = unreached.front();
    throw Error(Status::region, {Subject::vertex, first},
                "and the rest of the region are on other loose parts of the mesh than the handles, "
                "so that none can move them",
                Remedy::handle_on_part, std::move(unreached));
  }
  region.resting = std::move(resting);
  region.resting_component_count = resting_component_count;
  region.isolated = std::move(isolated);
  for (int v : region.free) {
    char& held = part_is_held[parts.of_vertex[v]];
    if (!held) region.grounds.push_back(v);
    held = 1;
  }
  region.idle_handles = idle_handles(mesh, region);
  return region;
}

}  // namespace dd
