// SPDX-License-Identifier: GPL-3.0-or-later
#include <Eigen/Dense>
#include <array>

#include "cases.h"
#include "catch.h"
#include "deform.h"
#include "dense_reference.h"
#include "mesh/measures.h"
#include "support/rotations.h"

using namespace dd;
using test::Affine;
using test::by;
using test::surface;

namespace {

const std::vector<Affine> kMotions = {
    test::rotation_about(0.6, {1, 0.3, 0}, {0, 0, 1}, {0.2, 0.1, 0.4}),
    test::rotation_about(-0.4, {0, 1, 1}, {0, 1, 0}, {0, 0.3, 0})};

/// A rough ball fixed below with two handles.
struct Ball {
  Mesh mesh = test::rough_sphere(2, 0.15);
  std::vector<int> roles = test::roles_by_height(mesh, -0.5, 0.7);
  Ball() {
    for (Index v = 0; v < mesh.positions.rows(); ++v)
      if (mesh.positions(v, 1) > 0.95) roles[v] = 1;
  }
};

/// exp by its power series: another way than the core's axis and angle.
Eigen::Matrix3d series_exponential(const Eigen::Matrix3d& A) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Identity(), term = sum;
  for (int k = 1; k < 30; ++k) {
    term = term * A / k;
    sum += term;
  }
  return sum;
}

}  // namespace

TEST_CASE("VARIATIONAL is the direct bi-Laplacian solve on S, whatever the base's metric") {
  const Ball ball;
  for (BaseMetric metric : {BaseMetric::surface, BaseMetric::base}) {
    Deformer deformer(ball.mesh, ball.roles, 2, {metric, 0});
    const auto dense = test::dense_transfer(ball.mesh, ball.roles, kMotions, false, true);
    CHECK(test::largest_difference(surface(deformer, kMotions, by(MethodKind::variational)),
                                   dense.variational) < 1e-9);
  }
}

TEST_CASE("GRADIENT equals a dense solve with weights, logarithms and gradients of its own") {
  const Ball ball;
  std::vector<Affine> handles = kMotions;
  handles[0].leftCols<3>() *= Eigen::Vector3d(1.3, 0.8, 1.1).asDiagonal();
  handles[1].leftCols<3>() *= 0.7;
  const auto dense = test::dense_operators(ball.mesh.positions, ball.mesh.triangles);
  const int n = ball.mesh.vertex_count(), m = ball.mesh.triangle_count();
  const Eigen::MatrixXd none = Eigen::MatrixXd::Zero(n, 3);
  Positions indicator = Positions::Zero(n, 3), held = ball.mesh.positions;
  for (int v = 0; v < n; ++v) {
    if (ball.roles[v] < 0) continue;
    indicator(v, ball.roles[v]) = 1;
    held.row(v) = test::transformed(handles[ball.roles[v]], held.row(v));
  }
  const Positions weights = test::dense_solve(dense.L, indicator, ball.roles, none);
  const Eigen::MatrixXd G = dense.G * ball.mesh.positions;
  Deformer deformer(ball.mesh, ball.roles, 2, {});
  for (bool rotation_only : {true, false}) {
    Eigen::MatrixXd gradients(3 * m, 3);
    for (int j = 0; j < m; ++j) {
      Eigen::Matrix3d turn = Eigen::Matrix3d::Zero(), stretch = Eigen::Matrix3d::Identity();
      for (int h = 0; h < 2; ++h) {
        double w = 0;
        for (int k = 0; k < 3; ++k) w += weights(ball.mesh.triangles(j, k), h) / 3;
        const Eigen::Matrix3d A = handles[h].leftCols<3>();
        const Eigen::Matrix3d R = test::polar_rotation(A);
        const double angle = std::acos((R.trace() - 1) / 2);
        turn += w * angle / (2 * std::sin(angle)) * (R - R.transpose());
        stretch += w * (R.transpose() * A - Eigen::Matrix3d::Identity());
      }
      Eigen::Matrix3d S = series_exponential(turn);
      if (!rotation_only) S *= stretch;
      gradients.middleRows<3>(3 * j) = G.middleRows<3>(3 * j) * S.transpose();
    }
    const Positions expected =
        test::dense_solve(dense.L, held, ball.roles, dense.G.transpose() * dense.D * gradients);
    const Positions result = surface(deformer, handles, by(MethodKind::gradient, rotation_only));
    CHECK(test::largest_difference(result, expected) < 1e-9);
  }
}

TEST_CASE("GRADIENT: a translation leaves the gradients alone, the flaw that the paper explains") {
  const auto plane = test::lifted_plane(61);
  Deformer deformer(plane.mesh, plane.roles, 1, {});
  const Positions result = surface(deformer, {plane.motion}, by(MethodKind::gradient));
  // With S's own gradients p' is p and a harmonic displacement: VarMin of order 1.
  Deformer membrane(plane.mesh, plane.roles, 1, {BaseMetric::surface, 0, Smoothness::membrane});
  CHECK(test::largest_difference(
            result, surface(membrane, {plane.motion}, by(MethodKind::variational))) < 1e-9);
}

TEST_CASE(
    "every method but VARIATIONAL follows handles that all turn together, resting gives rest") {
  const auto plane = test::lifted_plane(61);
  std::vector<int> roles = plane.roles;
  for (int& role : roles) role = role == kFree ? kFree : role == kFixed ? 0 : 1;
  Deformer deformer(plane.mesh, roles, 2, {});
  const Affine motion = test::rotation_about(0.7, {1, 2, 0.5}, {0.2, 0, 0}, {0.3, -1, 2});
  const Positions expected = test::transformed(motion, plane.mesh.positions);
  for (MethodKind method : {MethodKind::detail, MethodKind::gradient, MethodKind::variational,
                            MethodKind::normal, MethodKind::volumes})
    for (bool rotation_only : {true, false}) {
      const UpdateOptions options = by(method, rotation_only);
      CHECK(
          test::largest_difference(surface(deformer, {test::identity(), test::identity()}, options),
                                   plane.mesh.positions) < 1e-10);
      const double missed =
          test::largest_difference(surface(deformer, {motion, motion}, options), expected);
      // VarMin isn't rotation-invariant: p is not in the operator's null space.
      CHECK((method == MethodKind::variational ? missed > 1e-3 : missed < 1e-9));
    }
}

TEST_CASE("methods share a deformer without leaving traces in each other's results") {
  const Ball ball;
  UpdateOptions turned = test::usual();
  turned.base_deformer = BaseDeformer::motions;
  const std::vector<UpdateOptions> all = {by(MethodKind::detail),
                                          by(MethodKind::variational),
                                          by(MethodKind::gradient),
                                          by(MethodKind::detail, true, 3),
                                          test::usual(),
                                          turned,
                                          test::shown_base()};
  std::vector<Positions> alone;
  for (const UpdateOptions& options : all) {
    Deformer fresh(ball.mesh, ball.roles, 2, {});
    alone.push_back(surface(fresh, kMotions, options));
  }
  Deformer shared(ball.mesh, ball.roles, 2, {});
  for (int round = 0; round < 2; ++round)
    for (size_t k = 0; k < all.size(); ++k)
      CHECK(test::largest_difference(surface(shared, kMotions, all[k]), alone[k]) == 0);
}

TEST_CASE("showing the base gives B at rest and B' in a pose") {
  const Ball ball;
  Deformer deformer(ball.mesh, ball.roles, 2, {});
  const UpdateOptions shown = test::shown_base();
  CHECK(test::largest_difference(surface(deformer, {test::identity(), test::identity()}, shown),
                                 deformer.base()) < 1e-12);
  const auto dense = test::dense_transfer(ball.mesh, ball.roles, kMotions, false, true);
  CHECK(test::largest_difference(surface(deformer, kMotions, shown), dense.base_deformed) < 1e-9);
}

TEST_CASE("a part whose base collapses turns with the handle that alone holds it") {
  const Mesh ball = test::rough_sphere(3, 0.1);
  const Affine turn = test::rotation_about(std::acos(0.0), {0, 1, 0}, {0.3, 0, 0}, {0, 0, 2});
  const Positions turned = test::transformed(turn, ball.positions);
  std::vector<int> two(static_cast<size_t>(ball.vertex_count()), kFree);
  two[0] = two[1] = 0;
  SECTION("by two vertices") {
    Deformer deformer(ball, two, 1, {});
    for (int refine : {0, 3})
      CHECK(test::largest_difference(
                surface(deformer, {turn}, by(MethodKind::detail, true, refine)), turned) < 1e-8);
    CHECK(deformer.findings(MethodKind::detail).stand_in_count == ball.triangle_count());
  }
  SECTION("by three vertices in a line") {
    Mesh strip = test::bumpy_plane(21, 2);
    std::vector<int> roles(21 * 21, kFree);
    for (int k : {0, 10, 20}) roles[21 * 10 + k] = 0;
    Deformer deformer(strip, roles, 1, {});
    CHECK(test::largest_difference(surface(deformer, {turn}),
                                   test::transformed(turn, strip.positions)) < 1e-8);
  }
  SECTION("with its scale where that is asked for") {
    Affine scaled = turn;
    scaled.leftCols<3>() *= 1.5;
    Deformer deformer(ball, two, 1, {});
    CHECK(test::largest_difference(surface(deformer, {scaled}, false),
                                   test::transformed(scaled, ball.positions)) < 1e-8);
  }
  SECTION("one vertex has no rotation to give") {
    two[1] = kFree;
    Deformer deformer(ball, two, 1, {});
    const Positions shift = surface(deformer, {turn}) - ball.positions;
    CHECK((shift.rowwise() - shift.row(0)).cwiseAbs().maxCoeff() < 1e-8);
  }
}

TEST_CASE("a failure on the smoothed geometry names metric_smoothing, not the mesh") {
  const auto plane = test::lifted_plane(41);
  const auto blame = [&](const BindOptions& options) {
    return test::refusal([&] { Deformer(plane.mesh, plane.roles, 1, options); }, Status::numeric);
  };
  CHECK_THAT(blame({BaseMetric::surface, 1e9}), contains("lower metric_smoothing"));
}

TEST_CASE("NORMAL reconstructs S at rest at every level count, and follows rigid motions") {
  const auto plane = test::lifted_plane(71);
  const Ball ball;
  const Affine motion = test::rotation_about(0.7, {1, 2, 0.5}, {0.2, 0, 0}, {0.3, -1, 2});
  for (int levels : {1, 2, 3, 5}) {
    UpdateOptions options = by(MethodKind::normal);
    options.of_method.levels = levels;
    Deformer deformer(plane.mesh, test::held_by_one(plane.roles), 1, {});
    CHECK(test::largest_difference(surface(deformer, {test::identity()}, options),
                                   plane.mesh.positions) < 1e-9);
    CHECK(test::largest_difference(surface(deformer, {motion}, options),
                                   test::transformed(motion, plane.mesh.positions)) < 1e-9);
    CHECK(deformer.findings(MethodKind::normal).unrepresented.empty());
    // Random relief is no height field everywhere: vertices without a height must be as exact.
    Deformer rough(ball.mesh, ball.roles, 2, {});
    CHECK(test::largest_difference(surface(rough, {test::identity(), test::identity()}, options),
                                   ball.mesh.positions) < 1e-9);
  }
}

TEST_CASE("NORMAL: over a plane the heights are those of the relief, a known solution when bent") {
  // B is the plane z = 0 outside the bumps' reach: a lift that is affine in x leaves it a plane,
  // turned and stretched, and each vertex stands its own height above it along the new normal.
  const int side = 41;
  const double slope = 0.5;
  const Mesh mesh = test::grid(side, side, [](double x, double y) {
    const double bump = std::max(0.0, 1 - 12 * ((x - 0.5) * (x - 0.5) + (y - 0.5) * (y - 0.5)));
    return 0.2 * bump * bump;
  });
  std::vector<int> roles(static_cast<size_t>(side * side), kFree);
  for (int i = 0; i < side; ++i)
    for (int j = 0; j < side; ++j)
      if (std::min({i, j, side - 1 - i, side - 1 - j}) < 3) roles[i * side + j] = 0;
  Affine shear = test::identity();
  shear(2, 0) = slope;
  Deformer deformer(mesh, roles, 1, {});
  const Positions result = surface(deformer, {shear}, by(MethodKind::normal));
  const Eigen::RowVector3d normal = Eigen::RowVector3d(-slope, 0, 1).normalized();
  for (int v = 0; v < mesh.vertex_count(); ++v) {
    if (roles[v] != kFree) continue;
    const Eigen::RowVector3d p = mesh.positions.row(v);
    const Eigen::RowVector3d foot(p[0], p[1], slope * p[0]);
    CHECK((result.row(v) - (foot + p[2] * normal)).norm() < 1e-9);
  }
}

TEST_CASE("NORMAL counts vertices that no height over the base represents") {
  // A ball on a neck overhangs the plane it stands on.
  Mesh mesh = test::grid(41, 41, [](double, double) { return 0.0; });
  for (int v = 0; v < mesh.vertex_count(); ++v) {
    const Eigen::RowVector2d from(mesh.positions(v, 0) - 0.5, mesh.positions(v, 1) - 0.5);
    const double r = from.norm() / 0.3;
    if (r >= 1) continue;
    // Profile of a mushroom: the radius first shrinks, then swells, then closes.
    const double s = 1 - r,
                 radius = s < 0.4 ? 0.3 - 0.55 * s
                                  : 0.08 + 0.17 * std::sin((s - 0.4) / 0.6 * std::acos(-1.0));
    const Eigen::RowVector2d direction =
        r > 0 ? Eigen::RowVector2d(from / from.norm()) : Eigen::RowVector2d(1, 0);
    const double scale = r > 0 ? radius * std::min(1.0, r / 0.1) : 0;
    mesh.positions.row(v) << 0.5 + direction[0] * scale, 0.5 + direction[1] * scale, 0.4 * s;
  }
  std::vector<int> roles(41 * 41, kFree);
  for (int i = 0; i < 41; ++i)
    for (int j = 0; j < 41; ++j)
      if (std::min({i, j, 40 - i, 40 - j}) < 3) roles[i * 41 + j] = i < 20 ? kFixed : 0;
  Deformer deformer(mesh, roles, 1, {});
  CHECK(test::largest_difference(surface(deformer, {test::identity()}, by(MethodKind::normal)),
                                 mesh.positions) < 1e-9);
  const MethodFindings normal = deformer.findings(MethodKind::normal);
  CHECK(normal.unrepresented.size() > 20);
  CHECK(mesh.positions(normal.unrepresented.front(), 2) > 0);
  Affine lift = test::identity();
  lift(2, 3) = 0.3;
  const Positions lifted = surface(deformer, {lift}, by(MethodKind::normal));
  // The lift of half the border tilts the ball, which moves no part of it farther than the border.
  CHECK((lifted - mesh.positions).rowwise().norm().maxCoeff() < 1.1 * 0.3);
  // Turning all, with what was fixed for a second handle, turns the result.
  for (int& role : roles)
    if (role == kFixed) role = 1;
  Deformer held(mesh, roles, 2, {});
  const Affine turn = test::rotation_about(2.1, {1, 2, 0.5}, {0.2, 0, 0}, {0.3, -1, 2});
  Affine both = turn;
  both.col(3) += turn.leftCols<3>() * lift.col(3);
  CHECK(test::largest_difference(surface(held, {both, turn}, by(MethodKind::normal)),
                                 test::transformed(turn, lifted)) < 1e-9);
}

TEST_CASE("VOLUMES keeps the space between base and surface, whatever the unit") {
  const auto plane = test::lifted_plane(61);
  Deformer deformer(plane.mesh, plane.roles, 1, {});
  const Positions result = surface(deformer, {plane.motion}, by(MethodKind::volumes));
  CHECK(deformer.findings(MethodKind::volumes).converged);
  // The prisms' volumes by another formula: the mean over six ways of cutting a prism into three
  // tetrahedra. Both diagonals of a side err by as much, so the mean is the bilinear prism's.
  const auto volume = [&](const Positions& base, const Positions& over, Index j) {
    const auto corner = plane.mesh.triangles.row(j);
    double sum = 0;
    const auto tetrahedron = [](const Eigen::RowVector3d& a, const Eigen::RowVector3d& b,
                                const Eigen::RowVector3d& c, const Eigen::RowVector3d& d) {
      return (b - a).cross(c - a).dot(d - a) / 6;
    };
    for (const auto& [i, k, l] :
         {std::array<int, 3>{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {1, 0, 2}, {2, 1, 0}}) {
      const double sign = (k - i + 3) % 3 == 1 ? 1 : -1;
      const Eigen::RowVector3d q0 = base.row(corner[i]), q1 = base.row(corner[k]),
                               q2 = base.row(corner[l]), p0 = over.row(corner[i]),
                               p1 = over.row(corner[k]), p2 = over.row(corner[l]);
      sum += sign *
             (tetrahedron(q0, q1, q2, p2) + tetrahedron(q0, q1, p2, p1) +
              tetrahedron(q0, p1, p2, p0)) /
             6;
    }
    return sum;
  };
  const Positions base = deformer.base(), deformed_base = deformer.deformed_base();
  const Positions transfer = surface(deformer, {plane.motion}, by(MethodKind::detail));
  double total = 0, by_volumes = 0, by_transfer = 0;
  std::vector<double> rest(plane.roles.size(), 0), now = rest, other = rest;
  for (Index j = 0; j < plane.mesh.triangles.rows(); ++j)
    for (int k = 0; k < 3; ++k) {
      const int v = plane.mesh.triangles(j, k);
      rest[v] += volume(base, plane.mesh.positions, j);
      now[v] += volume(deformed_base, result, j);
      other[v] += volume(deformed_base, transfer, j);
    }
  for (size_t v = 0; v < rest.size(); ++v) {
    if (plane.roles[v] != kFree) continue;
    total += std::abs(rest[v]);
    by_volumes += std::abs(now[v] - rest[v]);
    by_transfer += std::abs(other[v] - rest[v]);
  }
  INFO("missing of the volume: " << by_volumes / total << ", by transfer " << by_transfer / total);
  CHECK(by_volumes / total ==
        Approx(deformer.findings(MethodKind::volumes).volume_error).epsilon(1e-6));
  CHECK(by_volumes < 0.05 * total);
  CHECK(by_volumes < 0.5 * by_transfer);

  Mesh large = plane.mesh;
  large.positions *= 1e4;
  Affine motion = plane.motion;
  motion.col(3) *= 1e4;
  Deformer scaled(large, plane.roles, 1, {});
  CHECK(test::largest_difference(surface(scaled, {motion}, by(MethodKind::volumes)) / 1e4, result) <
        1e-6);
}

TEST_CASE("VOLUMES tells how far it is, can be cancelled, and says when it stopped early") {
  const auto plane = test::lifted_plane(41);
  Deformer deformer(plane.mesh, plane.roles, 1, {});
  UpdateOptions options = by(MethodKind::volumes);
  int calls = 0;
  options.of_method.progress = [&](double fraction, Stage) {
    CHECK((fraction >= 0 && fraction < 1));
    return ++calls < 2;
  };
  CHECK_THAT(test::refusal([&] { surface(deformer, {plane.motion}, options); }, Status::cancelled),
             contains("cancelled"));
  options.of_method.progress = {};
  options.of_method.volume_iterations = 1;
  options.of_method.volume_tolerance = 1e-9;
  surface(deformer, {plane.motion}, options);
  CHECK(!deformer.findings(MethodKind::volumes).converged);
  // Where the surface is its own base there is no volume to keep. It goes where the base goes,
  // which is sheared as its border is.
  const Mesh flat = test::grid(21, 21, [](double, double) { return 0.0; });
  std::vector<int> border(21 * 21, kFree);
  for (int i = 0; i < 21; ++i)
    for (int j = 0; j < 21; ++j)
      if (std::min({i, j, 20 - i, 20 - j}) < 3) border[i * 21 + j] = 0;
  Affine shear = test::identity();
  shear(2, 0) = 0.5;
  Deformer bare(flat, border, 1, {});
  CHECK(test::largest_difference(surface(bare, {shear}, by(MethodKind::volumes)),
                                 test::transformed(shear, flat.positions)) < 1e-9);
  CHECK(bare.findings(MethodKind::volumes).converged);
}
