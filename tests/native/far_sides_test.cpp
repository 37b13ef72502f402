// SPDX-License-Identifier: GPL-3.0-or-later
// The outwardness of a body's surface in a pose.
#include "wear/far_sides.h"

#include <random>

#include "catch.h"
#include "mesh/triangles.h"
#include "meshes.h"

using namespace dd;

namespace {

/// The outwardness of each vertex' fan of triangles in a pose.
class Faced {
 public:
  explicit Faced(const Mesh& mesh)
      : surface_(mesh, pool_),
        far_(
            surface_, AabbTree(mesh), mesh.vertex_count(), [this](int v) { return point_patch(v); },
            pool_) {}

  Eigen::VectorXd in(const Positions& pose) {
    surface_.set_pose(pose, pool_);
    Eigen::VectorXd result(pose.rows());
    for (int v = 0; v < surface_.mesh().vertex_count(); ++v)
      result[v] = far_.outwardness(v, point_patch(v));
    return result;
  }

 private:
  FarSides::PointPatch point_patch(int v) const {
    return {surface_.mesh().positions.row(v), surface_.patch(surface_.fan(v))};
  }
  ThreadPool pool_{2};
  PosedSurface surface_;
  FarSides far_;
};

}  // namespace

TEST_CASE("a ray's first exit from a surface is that of a search through all triangles") {
  const Mesh mesh = test::rough_sphere(3, 0.3);
  const AabbTree tree(mesh);
  const Positions normals = triangle_normals(mesh.positions, mesh.triangles);
  std::mt19937 random(4);
  std::uniform_real_distribution<double> uniform(-1.5, 1.5);
  int found_count = 0;
  for (int i = 0; i < 300; ++i) {
    const Eigen::Vector3d from(uniform(random), uniform(random), uniform(random));
    Eigen::Vector3d way(uniform(random), uniform(random), uniform(random));
    if (i % 3 == 0) way = Eigen::Vector3d::Unit(i % 9 / 3);  // along an axis
    double first = std::numeric_limits<double>::infinity();
    for (int j = 0; j < mesh.triangle_count(); ++j) {
      Eigen::Matrix3d system;
      system.col(0) =
          (mesh.positions.row(mesh.triangles(j, 1)) - mesh.positions.row(mesh.triangles(j, 0)))
              .transpose();
      system.col(1) =
          (mesh.positions.row(mesh.triangles(j, 2)) - mesh.positions.row(mesh.triangles(j, 0)))
              .transpose();
      system.col(2) = -way;
      const Eigen::Vector3d solved =
          system.fullPivLu().solve(from - mesh.positions.row(mesh.triangles(j, 0)).transpose());
      if (normals.row(j).dot(way) > 0 && solved.minCoeff() >= 0 && solved[0] + solved[1] <= 1)
        first = std::min(first, solved[2] * way.norm());
    }
    const PointOnTriangle found = tree.first_exit(from, way, {0});
    CHECK((found.triangle >= 0) == std::isfinite(first));
    if (found.triangle < 0) continue;
    ++found_count;
    CHECK(std::sqrt(found.squared_distance) == Approx(first));
    CHECK((from + first * way.normalized() - found.position).norm() < 1e-9);
    Eigen::RowVector3d mean = Eigen::RowVector3d::Zero();
    for (int k = 0; k < 3; ++k)
      mean += found.barycentric[k] * mesh.positions.row(mesh.triangles(found.triangle, k));
    CHECK((mean.transpose() - found.position).norm() < 1e-9);
  }
  CHECK(found_count > 50);
}

TEST_CASE("rigid motion, size, squashing and bumps keep the outwardness") {
  const Mesh ball = test::sphere(4);
  Faced faced(ball);
  CHECK(faced.in(ball.positions).minCoeff() > 1 - 1e-12);
  for (double size : {0.05, 1.0, 30.0}) {
    Positions moved = test::transformed(test::rotation_about(2, {1, 2, 3}, {0, 0, 0}, {4, 5, 6}),
                                        size * ball.positions);
    CHECK(faced.in(moved).minCoeff() > 1 - 1e-9);
  }
  CHECK(faced.in(ball.positions * Eigen::Vector3d(1, 1, 0.3).asDiagonal()).minCoeff() > 0.5);
  // Thorns with flanks of some 80 degrees hide nothing from the opposite point.
  Positions thorny = ball.positions;
  for (Index v = 0; v < thorny.rows(); v += 5) thorny.row(v) *= 1.3;
  CHECK(faced.in(thorny).minCoeff() > 0.5);
}

TEST_CASE("rays along axes meet triangles that are flush with their boxes, and skip near ones") {
  Mesh slab;
  slab.positions.resize(8, 3);
  slab.positions << 0, 0, 1, 1, 0, 1, 1, 1, 1, 0, 1, 1, 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0;
  slab.triangles.resize(4, 3);
  slab.triangles << 0, 1, 2, 0, 2, 3, 4, 6, 5, 4, 7, 6;
  const AabbTree tree(slab);
  for (double x : {0.0, 0.5, 1.0})
    for (double y : {0.0, 0.5, 1.0})
      for (double z : {0.0, -0.0}) {
        const PointOnTriangle found = tree.first_exit({x, y, 1}, {z, z, -2}, {0});
        REQUIRE(found.triangle >= 2);
        CHECK((found.position - Eigen::Vector3d(x, y, 0)).norm() == 0);
        CHECK(tree.first_exit({x, y, 1}, {z, z, -2}, {1.5}).triangle < 0);
        CHECK(tree.first_exit({x, y, 1}, {z, z, 2}, {0}).triangle < 0);
      }
}

TEST_CASE("a sharp edge faces outwards however it is turned") {
  // Faces of unequal width meet at 12 degrees: the normal of one is more than 90 degrees off their
  // mean.
  Mesh blade;
  blade.positions.resize(3 * 9, 3);
  for (int i = 0; i < 9; ++i)
    blade.positions.middleRows(3 * i, 3) << 0, 0.1 * i, 0, 3, 0.1 * i, 0, std::cos(0.2), 0.1 * i,
        std::sin(0.2);
  std::vector<int> corners;
  for (int i = 0; i < 8; ++i)
    for (int k = 0; k < 3; ++k) {
      const int a = 3 * i + k, b = 3 * i + (k + 1) % 3;
      corners.insert(corners.end(), {a, a + 3, b, b, a + 3, b + 3});
    }
  blade.triangles = Eigen::Map<Triangles>(corners.data(), Index(corners.size() / 3), 3);
  for (int i = 0; i < 30; ++i) {
    const auto turned = [&](double by, double shift) {
      return test::transformed(
          test::rotation_about(by, {1, 2.0 + i, 3}, {0, 0, 0}, {shift, 2 * shift, 1}),
          blade.positions);
    };
    Faced faced({turned(0.1 * i, 0.3), blade.triangles});
    CHECK(faced.in(turned(1 + 0.2 * i, 5)).minCoeff() > 1 - 1e-6);
  }
}

TEST_CASE("outwardness falls continuously where a surface folds up and turns over") {
  const Mesh ball = test::sphere(4);
  Faced faced(ball);
  // The upper cap, pressed in x towards its middle and on through itself.
  Eigen::VectorXd before;
  for (double share = 1; share > -0.5; share -= 0.02) {
    Positions pose = ball.positions;
    for (Index v = 0; v < pose.rows(); ++v)
      if (pose(v, 2) > 0.8) pose(v, 0) *= share;
    const Eigen::VectorXd here = faced.in(pose);
    for (Index v = 0; v < pose.rows(); ++v) {
      if (ball.positions(v, 2) < 0.7) CHECK(here[v] > 1 - 1e-9);
      if (ball.positions(v, 2) > 0.9 && share < -0.1) CHECK(here[v] < 0.01);
    }
    if (before.size() > 0) CHECK((here - before).cwiseAbs().maxCoeff() < 0.5);
    before = here;
  }
}

TEST_CASE("a sheet has no opposite side: its outwardness stays 1") {
  const Mesh sheet = test::grid(9, 9, [](double x, double y) { return 0.1 * x * y; });
  Faced faced(sheet);
  CHECK(faced.in(-sheet.positions).minCoeff() == 1);
  CHECK(faced.in(sheet.positions * Eigen::Vector3d(0, 1, 1).asDiagonal()).minCoeff() == 1);
}
