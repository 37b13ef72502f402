// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/vertex_gradients.h"

#include <Eigen/Dense>

#include "catch.h"
#include "meshes.h"

using namespace dd;

namespace {

using RowMajor3d = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

Eigen::Matrix3d at(const VertexGradients& gradients, Index vertex) {
  return Eigen::Map<const RowMajor3d>(gradients.row(vertex).data());
}

Mesh bumpy() {
  return test::grid(17, 13, [](double x, double y) { return 0.1 * std::sin(9 * x + 5 * y); });
}

}  // namespace

TEST_CASE("vertex gradients of a rigid motion are its rotation") {
  const Mesh mesh = bumpy();
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(2.1, Eigen::Vector3d(1, -2, 0.5).normalized()).toRotationMatrix();
  const Positions moved =
      (mesh.positions * turn.transpose()).rowwise() + Eigen::RowVector3d(3, -1, 2);
  const VertexGradients found = vertex_gradients(mesh, moved);
  for (int v = 0; v < mesh.vertex_count(); ++v) CHECK((at(found, v) - turn).norm() < 1e-12);
}

TEST_CASE("vertex gradients of a plane that is stretched in itself are the stretch") {
  const Mesh mesh = test::grid(9, 9, [](double, double) { return 0.0; });
  Eigen::Matrix3d stretch = Eigen::Matrix3d::Identity();
  stretch.topLeftCorner<2, 2>() << 2, 0.3, -0.4, 0.5;
  const VertexGradients found = vertex_gradients(mesh, mesh.positions * stretch.transpose());
  for (int v = 0; v < mesh.vertex_count(); ++v) CHECK((at(found, v) - stretch).norm() < 1e-12);
}

TEST_CASE("a vertex gradient is the area-weighted mean of its triangles' gradients") {
  // A triangle's gradient is solved for from two of its edges and its normal.
  const Mesh mesh = bumpy();
  Positions moved = mesh.positions;
  for (Index v = 0; v < moved.rows(); ++v) {
    const double x = moved(v, 0), z = moved(v, 2);
    moved.row(v) << (1 + z) * std::sin(x), moved(v, 1) * (1 + 0.2 * x), (1 + z) * std::cos(x);
  }
  const VertexGradients found = vertex_gradients(mesh, moved);
  for (int v = 0; v < mesh.vertex_count(); v += 7) {
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    double weight = 0;
    for (int j = 0; j < mesh.triangle_count(); ++j) {
      if ((mesh.triangles.row(j).array() != v).all()) continue;
      Eigen::Matrix3d before, after;
      for (const auto& [p, columns] : {std::pair(&mesh.positions, &before), {&moved, &after}}) {
        const Eigen::Vector3d a = p->row(mesh.triangles(j, 0)), b = p->row(mesh.triangles(j, 1)),
                              c = p->row(mesh.triangles(j, 2));
        *columns << c - b, a - c, (b - a).cross(c - a).normalized();
      }
      const Eigen::Matrix3d gradient =
          before.transpose().colPivHouseholderQr().solve(after.transpose()).transpose();
      const double area = before.col(0).cross(before.col(1)).norm();
      sum += area * gradient;
      weight += area;
    }
    CHECK((at(found, v) - sum / weight).norm() < 1e-10);
  }
}

TEST_CASE("triangles without area don't enter vertex gradients") {
  Mesh mesh;
  mesh.positions.resize(6, 3);
  mesh.positions << 0, 0, 0, 1, 0, 0, 0, 1, 0, 2, 0, 0, 5, 5, 5, 3, 0, 0;
  mesh.triangles.resize(3, 3);
  mesh.triangles << 0, 1, 2, 0, 1, 3, 1, 3, 5;  // the last two are flat
  Positions moved = 3 * mesh.positions;
  moved.row(3) << 7, 8, 9;  // gives the second one an area when deformed
  const VertexGradients found = vertex_gradients(mesh, moved);
  Eigen::Matrix3d expected = 3 * Eigen::Matrix3d::Identity();
  expected(2, 2) = 1;
  for (int v : {0, 1, 2}) CHECK((at(found, v) - expected).norm() < 1e-12);
  for (int v : {3, 4, 5}) CHECK(at(found, v) == Eigen::Matrix3d::Identity());
  moved.row(2) = moved.row(0);  // takes the first one's area when deformed
  CHECK(at(vertex_gradients(mesh, moved), 0) == Eigen::Matrix3d::Identity());
}
