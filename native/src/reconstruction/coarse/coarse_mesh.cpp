// SPDX-License-Identifier: GPL-3.0-or-later
#include "reconstruction/coarse/coarse_mesh.h"

#include <Eigen/Dense>
#include <algorithm>
#include <utility>

#include "mesh/contraction.h"
#include "mesh/geodesic_distances.h"

namespace dd {

namespace {

/// The merge radius of each vertex, see contract().
std::vector<double> radii_of(const Mesh& part, const Region& region, double spacing,
                             double growth) {
  const auto n = static_cast<size_t>(part.vertex_count());
  std::vector<char> constrained(n, 0);
  for (int v : part.triangles.reshaped()) constrained[v] = region.role[v] != kFree;
  const std::vector<double> distance = geodesic_distances(part, constrained, spacing / growth);
  std::vector<double> radii(n, 0);
  for (int v : region.free) radii[v] = std::min(spacing, growth * distance[v]);
  // Triangles with a constrained corner are kept.
  for (int j = 0; j < part.triangle_count(); ++j)
    for (int k = 0; k < 3; ++k)
      if (constrained[part.triangles(j, k)])
        for (int other = 0; other < 3; ++other) radii[part.triangles(j, other)] = 0;
  return radii;
}

/// Barycentric weights of a point projected to the plane of triangle j; -1e9 each where that has no
/// area.
Eigen::Vector3d weights_in(const Mesh& mesh, int j, const Eigen::RowVector3d& point) {
  const Positions& p = mesh.positions;
  const Triangles& t = mesh.triangles;
  const Eigen::RowVector3d a = p.row(t(j, 0)), u = p.row(t(j, 1)) - a, v = p.row(t(j, 2)) - a,
                           x = point - a;
  const double uu = u.dot(u), uv = u.dot(v), vv = v.dot(v), det = uu * vv - uv * uv;
  // det / (|u|² |v|²) is sin² of the angle at a. Safety: below an angle of 1e-6 it is rounding.
  if (!(det > 1e-12 * uu * vv)) return {-1e9, -1e9, -1e9};
  const double s = (vv * x.dot(u) - uv * x.dot(v)) / det, r = (uu * x.dot(v) - uv * x.dot(u)) / det;
  return {1 - s - r, s, r};
}

}  // namespace

std::vector<int> triangles_with(const std::vector<char>& marked, const Triangles& triangles) {
  std::vector<int> found;
  for (int j = 0; j < static_cast<int>(triangles.rows()); ++j) {
    const auto corners = triangles.row(j);
    if (std::any_of(corners.begin(), corners.end(), [&](int v) { return marked[v] != 0; }))
      found.push_back(j);
  }
  return found;
}

std::vector<int> active_faces(const Mesh& mesh, const Region& region, const Triangles& triangles) {
  std::vector<char> active(region.role.size(), 0);
  for (int j : triangles_with_free_corners(region, triangles))
    for (int v : triangles.row(j)) active[size_t(v)] = 1;
  return triangles_with(active, mesh.triangles);
}

CoarseMesh::CoarseMesh(const Mesh& part, const Region& region, double its_spacing,
                       double its_growth)
    : spacing(its_spacing), growth(its_growth) {
  Contraction made = contract(part, radii_of(part, region, spacing, growth));
  mesh = {part.positions(made.vertices, kAllIndices), std::move(made.triangles)};
  vertices = std::move(made.vertices);
  of_vertex = std::move(made.of_vertex);
  for (int v : vertices) {
    roles.push_back(region.role[v]);
    free_count += roles.back() == kFree;
  }
}

std::shared_ptr<const CoarseMesh> contract_active(const Mesh& mesh, const Region& region,
                                                  const Triangles& triangles, double spacing,
                                                  double growth) {
  const std::vector<int> faces = active_faces(mesh, region, triangles);
  return std::make_shared<CoarseMesh>(Mesh{mesh.positions, mesh.triangles(faces, kAllIndices)},
                                      region, spacing, growth);
}

Eigen::VectorXd CoarseMesh::sums(const Eigen::VectorXd& of_vertices) const {
  Eigen::VectorXd sums = Eigen::VectorXd::Zero(mesh.vertex_count());
  for (size_t v = 0; v < of_vertex.size(); ++v)
    if (of_vertex[v] >= 0) sums[of_vertex[v]] += of_vertices[Index(v)];
  return sums;
}

PointOnTriangle point_near(const Mesh& mesh, const VertexTriangles& fans,
                           const Eigen::RowVector3d& point, int vertex) {
  // One-rings that are searched, the first of them around the given vertex.
  constexpr int kMostRings = 3;
  PointOnTriangle best;
  double least = -1e8;  // above the -1e9 of triangles without area
  for (int step = 0; step < kMostRings; ++step) {
    const double before = least;
    for (int j : fans.of(vertex)) {
      const Eigen::Vector3d weights = weights_in(mesh, j, point);
      if (weights.minCoeff() <= least) continue;
      least = weights.minCoeff();
      best.triangle = j;
      best.barycentric = weights;
    }
    if (least >= 0 || least == before) break;
    int corner = 0;
    best.barycentric.maxCoeff(&corner);
    if (mesh.triangles(best.triangle, corner) == vertex) break;
    vertex = mesh.triangles(best.triangle, corner);
  }
  if (best.triangle < 0) return best;
  best.barycentric = best.barycentric.cwiseMax(0);
  best.barycentric /= best.barycentric.sum();
  best.position = position_of(best, mesh.positions, mesh.triangles).transpose();
  best.squared_distance = (point.transpose() - best.position).squaredNorm();
  return best;
}

}  // namespace dd
