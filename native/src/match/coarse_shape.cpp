// SPDX-License-Identifier: GPL-3.0-or-later
#include "match/coarse_shape.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "mesh/contraction.h"
#include "mesh/topology.h"
#include "mesh/triangles.h"
#include "mesh/unit_box.h"

namespace dd {

namespace {

// Vertices that the radius of contraction aims at; twice as many are accepted. More resolve smaller
// features and take longer.
constexpr int kAimedVertices = 2500;
constexpr int kMaxSamples = 1000;    // of a map in the end: its time grows with their square
constexpr int kMaxContractions = 4;  // contractions, each by 1.5 times the radius of the one before

/// The triangles of the component with the largest area, or all if that is less than half of it.
Triangles main_component(const Mesh& mesh) {
  const Components parts(mesh.triangles, mesh.vertex_count());
  const Eigen::VectorXd areas = triangle_areas(mesh.positions, mesh.triangles);
  std::vector<double> sums(static_cast<size_t>(parts.count), 0.0);
  for (Index j = 0; j < areas.size(); ++j)
    sums[size_t(parts.of_vertex[size_t(mesh.triangles(j, 0))])] += areas[j];
  const auto largest = static_cast<int>(std::max_element(sums.begin(), sums.end()) - sums.begin());
  if (sums[size_t(largest)] < 0.5 * areas.sum()) return mesh.triangles;
  Triangles chosen(mesh.triangles.rows(), 3);
  Index count = 0;
  for (Index j = 0; j < mesh.triangles.rows(); ++j)
    if (parts.of_vertex[size_t(mesh.triangles(j, 0))] == largest)
      chosen.row(count++) = mesh.triangles.row(j);
  return chosen.topRows(count);
}

}  // namespace

std::vector<int> farthest_points(const Positions& positions, int count) {
  std::vector<int> chosen;
  Eigen::VectorXd squared_distances =
      Eigen::VectorXd::Constant(positions.rows(), std::numeric_limits<double>::infinity());
  Eigen::RowVector3d from = positions.colwise().mean();
  for (int i = 0; i < std::min<Index>(count, positions.rows()); ++i) {
    const Eigen::VectorXd distances = (positions.rowwise() - from).rowwise().squaredNorm();
    if (i == 0)
      squared_distances = distances;
    else
      squared_distances = squared_distances.cwiseMin(distances);
    Index next = 0;
    squared_distances.maxCoeff(&next);
    if (i == 0) squared_distances.setConstant(std::numeric_limits<double>::infinity());
    chosen.push_back(static_cast<int>(next));
    from = positions.row(next);
  }
  return chosen;
}

struct CoarseShape::ContractedPart {
  ContractedPart(const Mesh& given, const Triangles& triangles) {
    const Mesh part = {UnitBox(given.positions).into(given.positions), triangles};
    // A vertex that remains covers an area of about 2 radius².
    double radius =
        std::sqrt(triangle_areas(part.positions, part.triangles).sum() / (2 * kAimedVertices));
    // Nothing is merged where the mesh is narrow or non-manifold: larger radii may merge enough.
    for (int attempt = 0; attempt < kMaxContractions; ++attempt, radius *= 1.5) {
      contraction =
          contract(part, std::vector<double>(static_cast<size_t>(part.vertex_count()), radius));
      if (contraction.vertices.size() < 2 * kAimedVertices) break;
    }
    mesh.triangles = contraction.triangles;
    mesh.positions.resize(static_cast<Index>(contraction.vertices.size()), 3);
    for (size_t i = 0; i < contraction.vertices.size(); ++i)
      mesh.positions.row(static_cast<Index>(i)) = part.positions.row(contraction.vertices[i]);
    unit_positions = part.positions;
  }
  Contraction contraction;
  Mesh mesh;
  Positions unit_positions;  // positions of all vertices in the unit box
};

CoarseShape::CoarseShape(const Mesh& given)
    : CoarseShape(ContractedPart(given, main_component(given))) {}

CoarseShape::CoarseShape(ContractedPart&& part)
    : mesh(std::move(part.mesh)),
      vertices(std::move(part.contraction.vertices)),
      of_vertex(std::move(part.contraction.of_vertex)),
      triangle_normals(dd::triangle_normals(mesh.positions, mesh.triangles)),
      normals(summed_normals(mesh.positions, mesh.triangles)),
      areas(triangle_areas(mesh.positions, mesh.triangles)),
      samples(farthest_points(mesh.positions, kMaxSamples)),
      tree(mesh),
      connected(Components(mesh.triangles, mesh.vertex_count()).count == 1) {
  // Vertices of other components: the closest point's corner with the largest weight.
  for (size_t v = 0; v < of_vertex.size(); ++v) {
    if (of_vertex[v] >= 0) continue;
    const PointOnTriangle near = tree.nearest(
        part.unit_positions.row(static_cast<Index>(v)).transpose(), 10, [](int) { return true; });
    if (near.triangle < 0) continue;
    Index corner = 0;
    near.barycentric.maxCoeff(&corner);
    of_vertex[v] = mesh.triangles(near.triangle, corner);
  }
}

}  // namespace dd
