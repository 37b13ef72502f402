// SPDX-License-Identifier: GPL-3.0-or-later
#include "base/base_proxy.h"

#include "cases.h"
#include "catch.h"
#include "deform.h"
#include "mesh/aabb_tree.h"
#include "mesh/topology.h"

using namespace dd;
using test::Affine;

namespace {

Mesh flat(int columns, int rows) {
  return test::grid(columns, rows, [](double, double) { return 0.0; });
}

/// Rolls a sheet up about an axis along y: x becomes an angle.
Positions rolled(const Positions& p, double angle) {
  const double radius = 1 / angle;
  Positions result = p;
  for (Index v = 0; v < p.rows(); ++v) {
    const double turn = angle * p(v, 0), arm = radius - p(v, 2);
    result(v, 0) = arm * std::sin(turn);
    result(v, 2) = radius - arm * std::cos(turn);
  }
  return result;
}

/// Carries the surface by closest points and barycentric weights alone: the proxy's facets show.
Positions by_faces(const Mesh& surface, const Mesh& proxy, const Positions& deformed) {
  Positions result(surface.positions.rows(), 3);
  const AabbTree tree(proxy);
  for (Index v = 0; v < result.rows(); ++v) {
    const PointOnTriangle at =
        tree.nearest(surface.positions.row(v).transpose(), 10, [](int) { return true; });
    Eigen::Vector3d place = Eigen::Vector3d::Zero();
    for (int k = 0; k < 3; ++k)
      place += at.barycentric[k] * deformed.row(proxy.triangles(at.triangle, k)).transpose();
    result.row(v) = place.transpose();
  }
  return result;
}

/// The largest angle between a triangle and its neighbour, in radians.
double sharpest(const Mesh& of, const Positions& p) {
  const auto normal = [&](int j) {
    const Eigen::Vector3d a = p.row(of.triangles(j, 0));
    return (p.row(of.triangles(j, 1)).transpose() - a)
        .cross(p.row(of.triangles(j, 2)).transpose() - a)
        .normalized();
  };
  double largest = 0;
  const Edges edges(of.triangles);
  for (int e = 0; e < edges.count(); ++e) {
    if (edges.of(e).size() != 2) continue;
    const Eigen::Vector3d one = normal(edges.of(e).begin()[0].triangle());
    const Eigen::Vector3d other = normal(edges.of(e).begin()[1].triangle());
    largest = std::max(largest, std::atan2(one.cross(other).norm(), one.dot(other)));
  }
  return largest;
}

BindOptions on(const Mesh& proxy) {
  BindOptions options;
  options.base = proxy.positions;
  options.base_triangles = proxy.triangles;
  return options;
}

}  // namespace

TEST_CASE("a base of another topology carries the surface exactly along an affine map") {
  const Mesh surface = test::rough_sphere(3, 0.1);
  Mesh proxy = test::sphere(1);
  proxy.positions *= 1.2;
  const BaseProxy base(surface, proxy);
  ThreadPool pool(2);
  CHECK(test::largest_difference(base.carry(proxy.positions, pool), surface.positions) < 1e-14);
  const Affine turn = test::rotation_about(2.8, {1, 2, 0.3}, {3, 0, 1}, {1, -2, 0.5});
  CHECK(test::largest_difference(base.carry(test::transformed(turn, proxy.positions), pool),
                                 test::transformed(turn, surface.positions)) < 1e-13);
  CHECK(base.far.empty());
  CHECK(base.ambiguous.empty());

  // A flat proxy follows a shear within its plane exactly, too.
  const BaseProxy sheet(flat(30, 30), flat(4, 5));
  Affine shear = test::identity();
  shear(0, 1) = 0.7;
  shear(1, 1) = 1.6;
  CHECK(test::largest_difference(sheet.carry(test::transformed(shear, flat(4, 5).positions), pool),
                                 test::transformed(shear, flat(30, 30).positions)) < 1e-13);
}

TEST_CASE("none of the faces of a base of another topology shows on the surface") {
  const Mesh surface = flat(101, 41), proxy = flat(7, 4);
  ThreadPool pool(1);
  const double angle = 1.5;
  const Positions deformed = rolled(proxy.positions, angle);
  const Positions carried = BaseProxy(surface, proxy).carry(deformed, pool);
  const double even = angle / 100;  // between neighbouring columns of a sheet rolled evenly
  CHECK(sharpest(surface, by_faces(surface, proxy, deformed)) > 16 * even);
  CHECK(sharpest(surface, carried) < 3.2 * even);
  // The carried surface is nearer to the cylinder that the proxy approximates than its facets are.
  const Positions meant = rolled(surface.positions, angle);
  const auto error = [&](const Positions& p) { return (p - meant).rowwise().norm().mean(); };
  CHECK(error(carried) < 0.5 * error(by_faces(surface, proxy, deformed)));
}

TEST_CASE("details turn with a cage of another topology, whose facets and size don't show") {
  const Mesh surface = test::bumpy_plane(101, 6);
  Mesh cage = flat(9, 5);
  cage.positions.col(2).array() += 0.12;  // above the surface
  const double angle = 1.2;
  const Positions deformed = rolled(cage.positions, angle);
  std::vector<int> roles(size_t(surface.vertex_count()), kFree);
  Deformer deformer(surface, roles, 0, on(cage));
  CHECK(deformer.base_vertex_count() == cage.vertex_count());
  for (int refine : {0, 4}) {
    const Positions found =
        surface.positions + deformer.update(nullptr, test::usual(refine), &deformed);
    const Positions meant = rolled(surface.positions, angle);
    const Positions off = (found - meant).rowwise() - (found - meant).colwise().mean();
    CHECK(off.rowwise().norm().maxCoeff() < 0.02);
    CHECK(sharpest(surface, found) < sharpest(surface, meant) + 0.1);
  }
  const Positions still = cage.positions;
  CHECK(
      test::largest_difference(surface.positions + deformer.update(nullptr, test::usual(), &still),
                               surface.positions) < 1e-9);
}

TEST_CASE("a copy of the surface gives nearly the same result as a proxy and as a base") {
  const Mesh surface = test::rough_sphere(3, 0.05);
  std::vector<int> roles = test::roles_by_height(surface, -0.6, 2);
  const Positions bent = rolled(surface.positions, 0.4);
  BindOptions copy;
  copy.base = surface.positions;
  Deformer by_copy(surface, roles, 0, copy), by_proxy(surface, roles, 0, on(surface));
  const UpdateOptions options = test::usual();
  const Positions one = by_copy.update(nullptr, options, &bent);
  const Positions other = by_proxy.update(nullptr, options, &bent);
  CHECK(test::largest_difference(one, other) < 0.01 * bounding_box_diagonal(surface.positions));
}

TEST_CASE("vertices far from a base or between its parts are reported, a broken base is refused") {
  Mesh cage = flat(5, 5), above = cage;
  above.positions.col(2).array() += 0.4;
  Mesh wall;  // from one sheet up to the other
  wall = flat(30, 30);
  wall.positions.col(2) = 0.4 * wall.positions.col(0);
  wall.positions.col(0).setConstant(0.5);
  const BaseProxy between(wall, test::appended(cage, above));
  CHECK(between.ambiguous.size() == 2 * 30);
  const BaseProxy far(wall, cage);
  CHECK(far.ambiguous.empty());
  CHECK(far.far.size() > 300);
  CHECK(far.far.size() < 900);

  Mesh broken = cage;
  broken.triangles(3, 1) = 99;
  const std::vector<int> roles(size_t(wall.vertex_count()), kFree);
  CHECK(test::refusal([&] { Deformer(wall, roles, 0, on(broken)); }, Status::mesh)
            .find(" of the base ") != std::string::npos);
  BindOptions few;
  few.base = cage.positions;
  CHECK(test::refusal([&] { Deformer(wall, roles, 0, few); }, Status::argument)
            .find("25 vertices, the mesh 900") != std::string::npos);
  Deformer deformer(wall, roles, 0, on(cage));
  const Positions wrong = Positions::Zero(7, 3);
  CHECK(test::refusal([&] { deformer.update(nullptr, test::usual(), &wrong); }, Status::argument)
            .find("no deformed base") != std::string::npos);
}

TEST_CASE("faces without area in a base of another topology turn with their neighbours") {
  Mesh cage = flat(5, 5);
  Mesh sliver = cage;
  sliver.triangles.conservativeResize(cage.triangles.rows() + 1, 3);
  sliver.triangles.bottomRows(1) << 0, 1, 2;  // three vertices on a line
  const Mesh surface = test::bumpy_plane(31, 4);
  ThreadPool pool(1);
  const Positions deformed = rolled(cage.positions, 1);
  CHECK(test::largest_difference(BaseProxy(surface, cage).carry(deformed, pool),
                                 BaseProxy(surface, sliver).carry(deformed, pool)) < 1e-12);
}
