// SPDX-License-Identifier: GPL-3.0-or-later
#include "deform/draft.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "mesh/topology.h"
#include "mesh/triangles.h"
#include "reconstruction/coarse/coarse_mesh.h"

namespace dd {

namespace {

// Spacing of the coarse mesh's vertices as a fraction of √(deforming area). Derived: leaves some
// 1 / 0.01² = 10,000 vertices, however many the mesh has.
constexpr double kSpacingOfSize = 0.01;
// Largest fraction of the free vertices that may be left. Break-even: with more, the draft saves
// too little.
constexpr double kMaxDraftFraction = 0.25;

/// The faces within so many rings of the free vertices.
std::vector<int> faces_around(const Mesh& mesh, const Region& region, int rings) {
  std::vector<char> near(region.role.size(), 0);
  for (int v : region.free) near[v] = 1;
  std::vector<int> faces;
  for (int ring = 0; ring < rings; ++ring) {
    faces = triangles_with(near, mesh.triangles);
    for (int j : faces)
      for (int v : mesh.triangles.row(j)) near[v] = 1;
  }
  return faces;
}

/// The vertices of the coarse mesh, then one vertex of each handle that has none there.
std::vector<int> with_all_handles(const CoarseMesh& coarse, const Region& region) {
  std::vector<int> vertices = coarse.vertices;
  std::vector<char> there(static_cast<size_t>(region.handle_count), 0);
  for (int role : coarse.roles)
    if (role >= 0) there[role] = 1;
  for (int v : region.handle_vertices)
    if (!std::exchange(there[region.role[v]], 1)) vertices.push_back(v);
  return vertices;
}

}  // namespace

Draft::Draft(const Mesh& mesh, Region region, int threads)
    : pool_(threads),
      rest_(mesh.positions),
      region_(std::move(region)),
      box_(mesh.positions),
      centres_(HandleCoordinates(region_, mesh.positions).centres()),
      offsets_(Positions::Zero(mesh.vertex_count(), 3)) {}

std::unique_ptr<Draft> Draft::make(const Mesh& mesh, const std::vector<int>& roles,
                                   int handle_count, const BindOptions& options) {
  if (options.base.size() > 0) return nullptr;
  validate(mesh);
  std::unique_ptr<Draft> draft(
      new Draft(mesh, make_region(mesh, roles, handle_count), options.threads));
  const Region& region = draft->region_;
  // K couples free vertices with as many rings as its order; refinement takes the handles'
  // rotations from the second one.
  const int rings = std::max(2, static_cast<int>(options.smoothness));
  const std::vector<int> faces = faces_around(mesh, region, rings);
  const Mesh part{draft->box_.into(mesh.positions), mesh.triangles(faces, kAllIndices)};
  const double size = std::sqrt(triangle_areas(part.positions, part.triangles).sum());
  CoarseMesh coarse(part, region, kSpacingOfSize * size);
  if (coarse.free_count > kMaxDraftFraction * region.free_count()) return nullptr;

  const VertexTriangles fans(coarse.mesh.triangles, coarse.mesh.vertex_count());
  std::vector<PointOnTriangle> nearest;
  nearest.reserve(region.free.size());
  const AabbTree tree(coarse.mesh);  // where all triangles nearby lack area
  for (int v : region.free) {
    const Eigen::Vector3d x = part.positions.row(v);
    nearest.push_back(point_near(coarse.mesh, fans, x.transpose(), coarse.of_vertex[v]));
    if (nearest.back().triangle < 0)
      nearest.back() =
          tree.nearest(x, std::numeric_limits<double>::infinity(), [](int) { return true; });
  }

  const std::vector<int> vertices = with_all_handles(coarse, region);
  const auto of_coarse = [&](const Positions& all) {
    return Positions(all(vertices, kAllIndices));
  };
  std::vector<int> coarse_roles;
  coarse_roles.reserve(vertices.size());
  for (int v : vertices) coarse_roles.push_back(region.role[v]);
  BindOptions how = without_surfaces(options);
  how.threads = 1;  // the bind uses the other threads
  if (options.stiffness.size() > 0)
    how.stiffness = largest_merged(options.stiffness, coarse.of_vertex, vertices.size());
  how.metric_smoothing =
      options.metric_smoothing * mean_edge_length(mesh.positions, mesh.triangles) /
      (draft->box_.scale * mean_edge_length(coarse.mesh.positions, coarse.mesh.triangles));
  draft->coarse_rest_ = of_coarse(part.positions);
  draft->coarse_ = std::make_unique<Deformer>(
      Mesh{of_coarse(mesh.positions), coarse.mesh.triangles}, coarse_roles, handle_count, how);
  draft->carrier_ =
      std::make_unique<BaseProxy>(Positions(part.positions(region.free, kAllIndices)), nearest,
                                  Mesh{draft->coarse_rest_, std::move(coarse.mesh.triangles)});
  return draft;
}

const Positions& Draft::update(const double* matrices, UpdateOptions options) {
  if (options.method == MethodKind::examples)
    throw Error(Status::argument,
                "A draft has no examples, which say where vertices of handles go that it doesn't "
                "have: wait for the bind",
                Remedy::wait);
  if (!options.free.empty() && options.pivots.size() == 0) options.pivots = centres_;
  const Positions deformed = coarse_rest_ + coarse_->update(matrices, options) / box_.scale;
  const Positions carried = carrier_->carry(deformed, pool_);
  pool_.parallel_for(carried.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (int64_t r = begin; r < end; ++r) {
      const int v = region_.free[size_t(r)];
      offsets_.row(v) = box_.scale * carried.row(r) + box_.centre - rest_.row(v);
    }
  });
  // Free handles have the rotations found on the coarse mesh.
  std::vector<double> turns;
  const std::vector<double> moved = coarse_->completed_matrices(matrices, options, turns);
  for (int v : region_.handle_vertices) {
    const Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>> matrix(
        moved.data() + 12 * size_t(region_.role[v]));
    const Eigen::Vector3d x = rest_.row(v);
    offsets_.row(v) = (matrix.leftCols<3>() * x + matrix.col(3) - x).transpose();
  }
  return offsets_;
}

}  // namespace dd
