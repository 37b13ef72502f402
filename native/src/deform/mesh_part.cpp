// SPDX-License-Identifier: GPL-3.0-or-later
#include "deform/mesh_part.h"

#include <algorithm>
#include <tuple>
#include <utility>

#include "mesh/aabb_tree.h"
#include "mesh/triangles.h"
#include "reconstruction/free_lengths.h"
#include "reconstruction/section_rays.h"

namespace dd {

namespace {

// Rings of triangles around free vertices and handles. K of order 3 reads three of them, the
// smoothing of rims two more; the others keep the intrinsic Delaunay triangles those of the whole
// mesh, as an edge of the part's border can't be flipped. Tested by comparing bits.
constexpr int kRings = 8;
// Free lengths along the edges of a coarse surface, at most, as a multiple of those along the
// mesh's own.
constexpr double kOfCoarse = 1.5;

bool has_corner(const Triangles& t, Index j, const std::vector<char>& marked) {
  return marked[size_t(t(j, 0))] || marked[size_t(t(j, 1))] || marked[size_t(t(j, 2))];
}

/// Marks the corners of all triangles with a marked corner.
void grow(const Triangles& t, std::vector<char>& marked) {
  const std::vector<char> before = marked;
  for (Index j = 0; j < t.rows(); ++j)
    if (has_corner(t, j, before))
      for (int v : t.row(j)) marked[size_t(v)] = 1;
}

/// What rays into the inside of limbs can reach: a box around the active vertices.
Eigen::AlignedBox3d reached_by_rays(const Mesh& mesh, const Region& region) {
  std::vector<int> index = region.row, rims;
  std::vector<std::tuple<int, int, double>> edges;
  Eigen::AlignedBox3d box;
  const auto index_of = [&](int v) {
    if (index[size_t(v)] < 0) {
      index[size_t(v)] = region.free_count() + static_cast<int>(rims.size());
      rims.push_back(region.role[size_t(v)]);
    }
    return index[size_t(v)];
  };
  for (Index j = 0; j < mesh.triangles.rows(); ++j) {
    const auto corners = mesh.triangles.row(j);
    if (std::none_of(corners.begin(), corners.end(),
                     [&](int v) { return region.role[size_t(v)] == kFree; }))
      continue;
    for (int k = 0; k < 3; ++k) {
      const int v = corners[k], w = corners[(k + 1) % 3];
      box.extend(mesh.positions.row(v).transpose());
      edges.emplace_back(index_of(v), index_of(w),
                         (mesh.positions.row(v) - mesh.positions.row(w)).norm());
    }
  }
  const double reach =
      kOfCoarse * kSectionReach * free_lengths(region.free_count(), rims, edges).lengths.maxCoeff();
  box.min().array() -= reach;
  box.max().array() += reach;
  return box;
}

/// The vertices that are outermost along an axis, so that the part has the box of the whole mesh,
/// and a fixed vertex of each component of the others, by which it is known to be held.
void add_witnesses(const Mesh& mesh, const Region& region, const Components& components,
                   std::vector<char>& kept) {
  for (int axis = 0; axis < 3; ++axis) {
    Index lowest = 0, highest = 0;
    mesh.positions.col(axis).minCoeff(&lowest);
    mesh.positions.col(axis).maxCoeff(&highest);
    kept[size_t(lowest)] = kept[size_t(highest)] = 1;
  }
  std::vector<char> is_met(size_t(components.count), 0), is_held(is_met);
  for (size_t v = 0; v < kept.size(); ++v)
    if (kept[v]) is_met[size_t(components.of_vertex[v])] = 1;
  for (size_t v = 0; v < kept.size(); ++v) {
    const auto component = size_t(components.of_vertex[v]);
    if (region.role[v] == kFixed && is_met[component] && !std::exchange(is_held[component], 1))
      kept[v] = 1;
  }
}

}  // namespace

std::unique_ptr<MeshPart> MeshPart::make(const Mesh& mesh, const Region& region,
                                         double largest_fraction) {
  const auto count = size_t(mesh.vertex_count());
  const Triangles& t = mesh.triangles;
  if (double(region.free.size() + region.handle_vertices.size()) > largest_fraction * double(count))
    return nullptr;
  std::vector<char> near(count, 0);
  for (int v : region.free) near[size_t(v)] = 1;
  for (int v : region.handle_vertices) near[size_t(v)] = 1;
  for (int ring = 0; ring + 1 < kRings; ++ring) grow(t, near);
  const Eigen::AlignedBox3d reached = reached_by_rays(mesh, region);

  auto part = std::make_unique<MeshPart>();
  std::vector<char> kept(count, 0);
  for (int v : region.handle_vertices) kept[size_t(v)] = 1;
  for (Index j = 0; j < t.rows(); ++j) {
    if (!has_corner(t, j, near) && !reached.intersects(box_of(mesh, static_cast<int>(j)))) continue;
    part->triangles.push_back(static_cast<int>(j));
    for (int v : t.row(j)) kept[size_t(v)] = 1;
  }
  if (double(part->triangles.size()) > largest_fraction * double(t.rows())) return nullptr;
  Components components(t, mesh.vertex_count());
  add_witnesses(mesh, region, components, kept);

  std::vector<int> number(count, -1), roles;
  for (size_t v = 0; v < count; ++v) {
    if (!kept[v]) continue;
    number[v] = static_cast<int>(part->vertices.size());
    part->vertices.push_back(static_cast<int>(v));
    roles.push_back(region.role[v]);
  }
  part->mesh.positions = mesh.positions(part->vertices, kAllIndices);
  part->mesh.triangles = t(part->triangles, kAllIndices);
  for (int& v : part->mesh.triangles.reshaped()) v = number[size_t(v)];
  part->region = region_of_roles(std::move(roles), region.handle_count);

  auto whole = std::make_shared<WholeSurface>();
  whole->outwards = outward_signs(mesh, components);
  whole->area = triangle_areas(mesh.positions, t).sum();
  whole->mean_edge_length = mean_edge_length(mesh.positions, t);
  whole->components.count = components.count;
  for (int v : part->vertices)
    whole->components.of_vertex.push_back(components.of_vertex[size_t(v)]);
  part->whole = std::move(whole);
  return part;
}

Error MeshPart::of_whole(const Error& error) const {
  Subject subject = error.subject();
  if (subject.kind == Subject::vertex) subject.index = vertices[size_t(subject.index)];
  if (subject.kind == Subject::triangle) subject.index = triangles[size_t(subject.index)];
  std::vector<int> all = error.vertices();
  for (int& v : all) v = vertices[size_t(v)];
  return {error.status(), subject, error.message(), error.remedy(), std::move(all)};
}

double MeshPart::bytes() const {
  const size_t ints = vertices.size() + triangles.size() + region.role.size() + region.row.size() +
                      region.free.size() + region.handle_vertices.size() +
                      whole->components.of_vertex.size();
  return static_cast<double>(ints * sizeof(int));
}

}  // namespace dd
