// SPDX-License-Identifier: GPL-3.0-or-later
#include "deform/deformer.h"

#include <Eigen/Dense>
#include <limits>

#include "catch.h"
#include "deform.h"
#include "dense_reference.h"
#include "mesh/unit_box.h"
#include "meshes.h"

using namespace dd;
using test::Affine;
using test::refusal;
using test::surface;

namespace {

/// Fig. 1's plane: fixed on the left, one handle on the right.
struct Plane {
  int side;
  Mesh mesh;
  std::vector<int> roles;
  explicit Plane(int size = 61, int bumps = 6)
      : side(size),
        mesh(test::bumpy_plane(size, bumps)),
        roles(test::strip_roles(size, size, size / 9, size - size / 9)) {}
};

const Affine kLift = [] {
  Affine matrix = test::identity();
  matrix(2, 3) = 0.4;
  return matrix;
}();

/// Mean angle in degrees between each triangle's normal and its rest normal turned with the base.
double mean_normal_error(const Mesh& mesh, const Region& region, const Positions& base,
                         const Positions& base_deformed, const Positions& deformed) {
  double sum = 0;
  int count = 0;
  for (Index j = 0; j < mesh.triangles.rows(); ++j) {
    if (region.row[mesh.triangles(j, 0)] < 0) continue;
    const Eigen::Matrix3d R =
        test::polar_rotation(test::deformation_gradient(base, base_deformed, mesh.triangles, j));
    const double cosine = test::triangle_normal(deformed, mesh.triangles, j)
                              .dot(R * test::triangle_normal(mesh.positions, mesh.triangles, j));
    sum += std::acos(std::min(1.0, cosine));
    ++count;
  }
  return sum / count * 180 / std::acos(-1.0);
}

}  // namespace

TEST_CASE("resting handles give the rest shape") {
  const Plane plane;
  for (BaseMetric metric : {BaseMetric::surface, BaseMetric::base}) {
    Deformer deformer(plane.mesh, plane.roles, 1, {metric, 0});
    for (bool rotation_only : {true, false})
      CHECK(test::largest_difference(surface(deformer, {test::identity()}, rotation_only),
                                     plane.mesh.positions) <
            1e-9 * bounding_box_diagonal(plane.mesh.positions));
  }
}

TEST_CASE("the whole method equals the dense solve") {
  Mesh mesh = test::rough_sphere(2, 0.15);
  auto roles = test::roles_by_height(mesh, -0.5, 0.7);
  for (Index v = 0; v < mesh.positions.rows(); ++v)
    if (mesh.positions(v, 1) > 0.95) roles[v] = 1;
  const std::vector<Affine> handles = {
      test::rotation_about(0.6, {1, 0.3, 0}, {0, 0, 1}, {0.2, 0.1, 0.4}),
      test::rotation_about(-0.4, {0, 1, 1}, {0, 1, 0}, {0, 0.3, 0})};
  for (BaseMetric metric : {BaseMetric::surface, BaseMetric::base}) {
    Deformer deformer(mesh, roles, 2, test::as_given(metric));
    for (bool rotation_only : {true, false}) {
      const auto dense =
          test::dense_transfer(mesh, roles, handles, metric == BaseMetric::base, rotation_only);
      const Positions result = surface(deformer, handles, rotation_only);
      CHECK(test::largest_difference(result, dense.surface) < 1e-9);
      CHECK(test::largest_difference(deformer.base(), dense.base) < 1e-9);
    }
  }
}

TEST_CASE("a rigid motion of every constrained vertex moves the mesh rigidly") {
  const Plane plane;
  std::vector<int> roles = plane.roles;
  for (int& role : roles) role = role == kFree ? kFree : role == kFixed ? 0 : 1;
  const Affine motion = test::rotation_about(0.7, {1, 2, 0.5}, {0.2, 0, 0}, {0.3, -1, 2});
  const Positions expected = test::transformed(motion, plane.mesh.positions);
  for (double smoothing : {0.0, 2.0}) {
    Deformer deformer(plane.mesh, roles, 2, {BaseMetric::surface, smoothing});
    for (bool rotation_only : {true, false})
      CHECK(test::largest_difference(surface(deformer, {motion, motion}, rotation_only), expected) <
            1e-9);
  }
  // The paper's own metric misses the rigid motion by far, which is why it isn't the default.
  Deformer deformer(plane.mesh, roles, 2, {BaseMetric::base, 0});
  CHECK(test::largest_difference(surface(deformer, {motion, motion}), expected) > 1e-2);
}

TEST_CASE("an affine motion of every constrained vertex moves the base affinely") {
  const Plane plane;
  std::vector<int> roles = plane.roles;
  for (int& role : roles) role = role == kFree ? kFree : role == kFixed ? 0 : 1;
  std::srand(2);
  const Affine motion = test::identity() + 0.4 * Affine::Random();
  Deformer deformer(plane.mesh, roles, 2, {});
  surface(deformer, {motion, motion});
  CHECK(test::largest_difference(deformer.deformed_base(),
                                 test::transformed(motion, deformer.base())) < 1e-9);
}

TEST_CASE("unit, place and numbering of the mesh change nothing but rounding") {
  const Mesh mesh = test::rough_sphere(3, 0.1);
  const auto roles = test::roles_by_height(mesh, -0.6, 0.7);
  const Affine motion = test::rotation_about(0.8, {1, 1, 0}, {0, 0, 0.9}, {0.1, 0.2, 0.3});
  Deformer reference(mesh, roles, 1, {});
  const Positions expected = surface(reference, {motion});

  SECTION("scale") {
    for (double scale : {1e-4, 1e4}) {
      Mesh scaled = mesh;
      scaled.positions *= scale;
      Affine scaled_motion = motion;
      scaled_motion.col(3) *= scale;
      Deformer deformer(scaled, roles, 1, {});
      CHECK(test::largest_difference(surface(deformer, {scaled_motion}) / scale, expected) < 1e-10);
    }
  }
  SECTION("place") {
    const Eigen::RowVector3d far(300, -200, 100);
    Mesh moved = mesh;
    moved.positions.rowwise() += far;
    Affine moved_motion = motion;
    moved_motion.col(3) += far.transpose() - motion.leftCols<3>() * far.transpose();
    Deformer deformer(moved, roles, 1, {});
    CHECK(test::largest_difference(surface(deformer, {moved_motion}).rowwise() - far, expected) <
          1e-9);
  }
  SECTION("numbering of vertices and triangles") {
    const auto other = test::renumbered(mesh, roles);
    Deformer deformer(other.mesh, other.roles, 1, {});
    const Positions result = surface(deformer, {motion});
    for (size_t v = 0; v < roles.size(); ++v)
      CHECK((result.row(other.new_of_old[v]) - expected.row(Index(v))).norm() < 1e-9);
  }
}

TEST_CASE("Fig. 1: details turn with the base where variational minimization alone shears them") {
  const Plane plane(121, 12);
  Deformer deformer(plane.mesh, plane.roles, 1, {});
  const Positions result = surface(deformer, {kLift});
  const Positions base = deformer.base(), base_deformed = deformer.deformed_base();
  // With the surface metric VarMin's displacement equals that of the base.
  const Positions variational = plane.mesh.positions + base_deformed - base;
  const auto error = [&](const Positions& p) {
    return mean_normal_error(plane.mesh, deformer.region(), base, base_deformed, p);
  };
  const double turned = error(result), sheared = error(variational);
  INFO("mean angle: transfer " << turned << ", variational minimization " << sheared);
  CHECK(error(plane.mesh.positions) > 10);  // the measure sees that the base turned
  CHECK(turned < 4);
  CHECK(sheared > 2 * turned);
}

TEST_CASE("handle vertices follow their matrix, fixed ones stay, whatever the handle's size") {
  const Plane plane;
  std::vector<int> roles = plane.roles;
  roles[30 * 61 + 30] = 1;  // a handle of a single vertex, in the middle of the region
  const Affine turn = test::rotation_about(0.5, {0, 1, 0}, {1, 0.5, 0}, {0, 0, 0.2});
  const Affine pull = test::rotation_about(1, {1, 0, 0}, {0.5, 0.5, 0}, {0, 0, 0.3});
  Deformer deformer(plane.mesh, roles, 2, {});
  const Positions result = surface(deformer, {turn, pull});
  CHECK(result.allFinite());
  for (int v = 0; v < plane.mesh.vertex_count(); ++v) {
    if (roles[v] == kFixed) CHECK(result.row(v) == plane.mesh.positions.row(v));
    if (roles[v] >= 0)
      CHECK((result.row(v) - test::transformed(roles[v] ? pull : turn, plane.mesh.positions.row(v)))
                .norm() < 1e-12);
  }
}

TEST_CASE("one vertex can hold a whole closed surface: its rotation alone moves nothing else") {
  const Mesh mesh = test::rough_sphere(2, 0.1);
  std::vector<int> roles(static_cast<size_t>(mesh.vertex_count()), kFree);
  roles[3] = 0;
  Affine shift = test::identity();
  shift.col(3) << 1, 2, 3;
  Deformer deformer(mesh, roles, 1, {});
  CHECK(test::largest_difference(surface(deformer, {shift}),
                                 test::transformed(shift, mesh.positions)) < 1e-8);
}

TEST_CASE("real meshes' faults are survived: loose, doubled, folded, many-sheeted, degenerate") {
  Mesh mesh = test::bumpy_plane(31, 4);
  const int side = 31;
  const Index n = mesh.positions.rows(), m = mesh.triangles.rows();
  mesh.positions.conservativeResize(n + 4, 3);
  mesh.positions.row(n) << 0.5, 0.5, 0.4;                          // fin on an inner edge
  mesh.positions.row(n + 1) << 1, 1, 0.5;                          // loose vertex
  mesh.positions.row(n + 2) = mesh.positions.row(15 * side + 15);  // doubled vertex
  mesh.positions.row(n + 3) << 0.25, 0.25, 0;
  mesh.triangles.conservativeResize(m + 5, 3);
  const int a = 15 * side + 15, b = a + side;
  mesh.triangles.row(m) << a, b, int(n);
  mesh.triangles.row(m + 1) = mesh.triangles.row(m / 2);  // duplicate face
  mesh.triangles.row(m + 2) << a, b, int(n + 2);          // zero area: two corners in one place
  mesh.triangles.row(m + 3) << a, a + 2 * side, int(n + 2);
  mesh.triangles.row(m + 4) << 7 * side + 7, 7 * side + 8, int(n + 3);
  auto roles = test::strip_roles(side, side, 4, 27);
  roles.resize(static_cast<size_t>(n + 4), kFree);
  for (BaseMetric metric : {BaseMetric::surface, BaseMetric::base}) {
    Deformer deformer(mesh, roles, 1, {metric, 0});
    CHECK(deformer.region().isolated == std::vector<int>{static_cast<int>(n) + 1});
    CHECK(std::count(deformer.degenerate_triangles().begin(), deformer.degenerate_triangles().end(),
                     int(m + 2)) == 1);
    const Positions result = surface(deformer, {kLift});
    REQUIRE(result.allFinite());
    CHECK(result.row(n + 1) == mesh.positions.row(n + 1));
    CHECK(result.col(2).maxCoeff() < 1);
    CHECK(result.col(2).minCoeff() > -0.2);
  }
  // Rigid motions stay exact: a degenerate triangle takes a neighbour's gradient.
  for (int& role : roles) role = role == kFixed ? 0 : role;
  const Affine motion = test::rotation_about(0.7, {0, 1, 2}, {0, 0, 0}, {1, 0, 0});
  Deformer deformer(mesh, roles, 1, {});
  Positions expected = test::transformed(motion, mesh.positions);
  expected.row(n + 1) = mesh.positions.row(n + 1);
  CHECK(test::largest_difference(surface(deformer, {motion}), expected) < 1e-9);
}

TEST_CASE("handles may collapse or mirror: the result stays finite, and equals the dense solve") {
  const Plane plane;
  Deformer deformer(plane.mesh, plane.roles, 1, {});
  const Mesh ball = test::rough_sphere(2, 0.15);
  const std::vector<int> roles = test::roles_by_height(ball, -0.5, 0.7);
  Deformer small(ball, roles, 1, test::as_given());
  for (const Eigen::Vector3d& scale : {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(1, 1, 0),
                                       Eigen::Vector3d(-1, 1, 1), Eigen::Vector3d(1e6, 1, 1)}) {
    Affine matrix = test::identity();
    matrix.leftCols<3>() = scale.asDiagonal();
    for (bool rotation_only : {true, false}) {
      CHECK(surface(deformer, {matrix}, rotation_only).allFinite());
      const Positions expected =
          test::dense_transfer(ball, roles, {matrix}, false, rotation_only).surface;
      // Beside a handle that is one point, triangles are lines, whose gradients (15) leaves open:
      // the dense solve and the core choose others.
      const double tolerance = scale.isZero() ? 0.05 : 1e-12 * expected.cwiseAbs().maxCoeff();
      CHECK(test::largest_difference(surface(small, {matrix}, rotation_only), expected) <
            tolerance);
    }
  }
}

TEST_CASE("updates do not depend on earlier ones") {
  const Plane plane;
  Deformer deformer(plane.mesh, plane.roles, 1, {});
  const Affine turn = test::rotation_about(0.9, {0, 1, 0}, {1, 0.5, 0}, {-0.1, 0, 0.2});
  const Positions first = surface(deformer, {turn});
  surface(deformer, {kLift}, false);
  surface(deformer, {test::identity()});
  CHECK(test::largest_difference(surface(deformer, {turn}), first) == 0);
}

TEST_CASE("matrices that are not finite are refused and named") {
  const Plane plane;
  std::vector<int> roles = plane.roles;
  roles[1900] = 1;
  Deformer deformer(plane.mesh, roles, 2, {});
  Affine bad = test::identity();
  bad(1, 2) = std::numeric_limits<double>::quiet_NaN();
  CHECK_THAT(refusal([&] { surface(deformer, {test::identity(), bad}); }, Status::argument),
             contains("Handle 1"));
  bad(1, 2) = 1e308;
  CHECK_THAT(refusal([&] { surface(deformer, {bad, bad}); }, Status::numeric),
             contains("too large"));
  // What was refused left nothing behind.
  Deformer fresh(plane.mesh, roles, 2, {});
  CHECK(surface(deformer, {kLift, kLift}) == surface(fresh, {kLift, kLift}));
}

TEST_CASE("a bind reports rising progress and can be cancelled at each stage") {
  const Plane plane(31, 4);
  std::vector<double> fractions;
  Deformer(plane.mesh, plane.roles, 1, {}, [&](double fraction, Stage stage) {
    CHECK(stage <= Stage::done);
    fractions.push_back(fraction);
    return true;
  });
  REQUIRE(fractions.size() >= 4);
  CHECK(std::is_sorted(fractions.begin(), fractions.end()));
  CHECK(fractions.back() == 1);
  for (size_t stop = 0; stop < fractions.size(); ++stop) {
    size_t calls = 0;
    const auto cancelled = [&] {
      Deformer(plane.mesh, plane.roles, 1, {}, [&](double, Stage) { return calls++ < stop; });
    };
    CHECK_THAT(refusal(cancelled, Status::cancelled), contains("cancelled"));
  }
}

TEST_CASE("a refused update leaves the output as it was") {
  const Plane plane(41, 4);
  BindOptions options;
  options.threads = 2;
  Deformer deformer(plane.mesh, plane.roles, 1, options);
  const std::vector<float> untouched(static_cast<size_t>(plane.mesh.positions.size()), -77.0f);
  for (double large : {1e39, 1e308})
    for (int entry : {0, 3})
      for (bool positions : {true, false}) {
        Affine motion = test::identity();
        motion.data()[entry] = large;
        std::vector<float> out = untouched;
        CHECK_THROWS_AS(deformer.update_to(out.data(), 3, positions, motion.data(),
                                           test::by(MethodKind::detail)),
                        Error);
        CHECK(out == untouched);
      }
  // 1e38 fits into a float and is written, though the sum over all vertices doesn't fit.
  Affine far = test::identity();
  far(2, 3) = 1e38;
  std::vector<float> out = untouched;
  deformer.update_to(out.data(), 3, false, far.data(), test::by(MethodKind::variational));
  CHECK(*std::max_element(out.begin(), out.end()) == Approx(1e38));
}

TEST_CASE("an unknown method is refused") {
  const Plane plane(21, 2);
  Deformer deformer(plane.mesh, plane.roles, 1, {});
  for (int kind : {-1, 6, 7, 1000})
    CHECK_THAT(
        test::refusal([&] { surface(deformer, {kLift}, test::by(static_cast<MethodKind>(kind))); },
                      Status::argument),
        contains("There is no method " + std::to_string(kind)));
  CHECK(deformer.bytes() > 0);
  CHECK(deformer.findings(MethodKind::examples).example_weights.empty());
}
