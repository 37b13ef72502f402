// SPDX-License-Identifier: GPL-3.0-or-later
#include "match/fit_goals.h"

#include "catch.h"
#include "mesh/triangles.h"
#include "meshes.h"

using namespace dd;
using test::largest_difference;

namespace {

constexpr double kAnyReach = 10;

/// The nearest point of all triangles whose normal is less than 90 degrees off.
PointOnTriangle nearest_of_all(const Mesh& mesh, const Eigen::RowVector3d& point,
                               const Eigen::RowVector3d& normal) {
  PointOnTriangle best;
  const Positions normals = triangle_normals(mesh.positions, mesh.triangles);
  for (int j = 0; j < mesh.triangle_count(); ++j) {
    if (!(normals.row(j).dot(normal) > 0)) continue;
    const PointOnTriangle there = nearest_on_triangle(mesh, j, point.transpose());
    if (there.squared_distance < best.squared_distance) best = there;
  }
  return best;
}

/// The areas around each vertex as seen along its normal, up to a common factor.
Eigen::VectorXd areas_about(const Mesh& mesh) {
  const Eigen::VectorXd areas = triangle_areas(mesh.positions, mesh.triangles);
  Positions sums = Positions::Zero(mesh.vertex_count(), 3);
  for (int j = 0; j < mesh.triangle_count(); ++j)
    for (int v : mesh.triangles.row(j))
      sums.row(v) +=
          edges_and_normal(mesh.positions, mesh.triangles, j).col(2).normalized() * 2 * areas[j];
  return sums.rowwise().norm();
}

Mesh stretched(Mesh mesh, double x, double others) {
  mesh.positions.col(0) *= x;
  mesh.positions.rightCols(2) *= others;
  return mesh;
}

}  // namespace

TEST_CASE("goals of a surface on itself are its own vertices, both ways") {
  const Mesh mesh = test::rough_sphere(3, 0.1);
  ThreadPool pool(2);
  const GoalFinder finder(mesh, mesh, 0.1, pool);
  CHECK(largest_difference(finder.nearest(mesh).positions, mesh.positions) < 1e-12);
  CHECK(largest_difference(finder.both_ways(mesh).positions, mesh.positions) < 1e-12);
}

TEST_CASE("goals both ways equal those of a search through all triangles") {
  const Mesh source = test::rough_sphere(2, 0.1, 3);
  const Mesh target = stretched(test::rough_sphere(3, 0.1, 5), 1.3, 0.9);
  ThreadPool pool(2);
  const FitGoals goals = GoalFinder(source, target, kAnyReach, pool).both_ways(source);

  const Positions normals[2] = {summed_normals(source.positions, source.triangles),
                                summed_normals(target.positions, target.triangles)};
  const Eigen::VectorXd areas[2] = {areas_about(source), areas_about(target)};
  Eigen::MatrixXd weights = Eigen::MatrixXd::Zero(source.vertex_count(), target.vertex_count());
  Positions ways(target.vertex_count(), 3);
  for (int v = 0; v < target.vertex_count(); ++v) {
    const PointOnTriangle there =
        nearest_of_all(source, target.positions.row(v), normals[1].row(v));
    ways.row(v) = target.positions.row(v) - there.position.transpose();
    for (int k = 0; k < 3; ++k)
      weights(source.triangles(there.triangle, k), v) = areas[1][v] * there.barycentric[k];
  }
  double most = 0;
  for (int v = 0; v < source.vertex_count(); ++v) {
    const Eigen::RowVector3d own =
        nearest_of_all(target, source.positions.row(v), normals[0].row(v)).position.transpose() -
        source.positions.row(v);
    const double landed = weights.row(v).sum(), share = std::min(1.0, landed / areas[0][v]);
    Eigen::RowVector3d way = own;
    if (landed > 0) way = (own + share * weights.row(v) * ways / landed) / (1 + share);
    most = std::max(most, (goals.positions.row(v) - source.positions.row(v) - way).norm());
  }
  CHECK(most < 1e-12);
  CHECK((weights.rowwise().sum().array() > 0).count() > source.vertex_count() / 2);
}

TEST_CASE("ends of the target attract those of the source") {
  const Mesh source = stretched(test::sphere(4), 1, 0.2);
  const Mesh target = stretched(test::sphere(4), 1.15, 0.2);
  ThreadPool pool(1);
  const GoalFinder finder(source, target, 0.2, pool);
  Index tip = 0;
  source.positions.col(0).maxCoeff(&tip);
  const double away = target.positions.col(0).maxCoeff() - source.positions(tip, 0);
  CHECK(finder.nearest(source).positions(tip, 0) - source.positions(tip, 0) < 0.25 * away);
  CHECK(finder.both_ways(source).positions(tip, 0) - source.positions(tip, 0) > 0.3 * away);
}

TEST_CASE("a target beyond a border of the source attracts nothing") {
  const auto flat = [](double, double) { return 0.0; };
  const Mesh source = test::grid(10, 10, flat);
  Mesh target = test::grid(40, 40, flat);
  target.positions = (3 * target.positions).rowwise() + Eigen::RowVector3d(-1, -1, 0.01);
  ThreadPool pool(1);
  const FitGoals goals = GoalFinder(source, target, 0.2, pool).both_ways(source);
  const Positions above = source.positions.rowwise() + Eigen::RowVector3d(0, 0, 0.01);
  CHECK(largest_difference(goals.positions, above) < 1e-12);
}
