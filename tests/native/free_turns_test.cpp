// SPDX-License-Identifier: GPL-3.0-or-later
#include "base/free_turns.h"

#include "cases.h"
#include "catch.h"
#include "deform/split_motion.h"
#include "limbs.h"
#include "mesh/measures.h"
#include "support/rotations.h"
#include "tapered_limb.h"

using namespace dd;
using test::Affine;
using test::surface;

namespace {

UpdateOptions placed(std::vector<char> free, int refine = 4) {
  UpdateOptions options = test::usual(refine);
  options.free = std::move(free);
  return options;
}

Affine moved(double x, double y, double z) {
  Affine motion = test::identity();
  motion.col(3) << x, y, z;
  return motion;
}

/// A tube with three handles, whose lowest part is fixed or in the first handle.
test::Case three_handles(bool fixed) {
  test::Case made = test::bent_cylinder();
  for (size_t v = 0; v < made.roles.size(); ++v) {
    const double z = made.mesh.positions(Index(v), 2);
    made.roles[v] = z < 0.2 && fixed           ? kFixed
                    : z < 0.3                  ? 0
                    : z > 1.4                  ? 1
                    : std::abs(z - 0.8) < 0.05 ? 2
                                               : kFree;
  }
  return made;
}

double stretch(const test::Case& of, const Positions& deformed) {
  std::vector<char> free;
  for (int role : of.roles) free.push_back(role == kFree);
  return measure(of.mesh, deformed, free).stretch;
}

/// The rotation that fits a role's vertices from rest to the pose, and the largest error it leaves.
struct Fit {
  Eigen::Matrix3d rotation;
  double miss;
};
Fit fit(const test::Case& of, int role, const Positions& deformed) {
  Positions from(0, 3), to(0, 3);
  for (size_t v = 0; v < of.roles.size(); ++v) {
    if (of.roles[v] != role) continue;
    from.conservativeResize(from.rows() + 1, 3);
    to.conservativeResize(to.rows() + 1, 3);
    from.bottomRows(1) = of.mesh.positions.row(Index(v));
    to.bottomRows(1) = deformed.row(Index(v));
  }
  from.rowwise() -= from.colwise().mean().eval();
  to.rowwise() -= to.colwise().mean().eval();
  const Eigen::Matrix3d R = test::polar_rotation(to.transpose() * from);
  return {R, test::largest_difference(from * R.transpose(), to)};
}

}  // namespace

TEST_CASE("a handle that only places goes along with a rigid motion of the others") {
  const test::Case tube = three_handles(false);
  Deformer deformer(tube.mesh, tube.roles, 3, {});
  for (double angle : {0.0, 0.4, 1.5, 2.9, 4.5}) {
    INFO(angle);
    const Eigen::Vector3d axis = Eigen::Vector3d(1, 2, -0.5).normalized();
    const Affine motion = test::rotation_about(angle, axis, {0.3, 0, 2}, {0.4, -1, 2});
    // The free handle's own matrix turns and scales as well, which must be ignored.
    const Eigen::Vector3d centre =
        handle_centres(deformer.region(), tube.mesh.positions).row(2).transpose();
    Affine places = test::rotation_about(0.7, {0, 1, 1}, centre, {0, 0, 0});
    places.leftCols<3>() *= 3;
    places.col(3) = motion.leftCols<3>() * centre + motion.col(3) - places.leftCols<3>() * centre;
    const Positions expected = test::transformed(motion, tube.mesh.positions);
    for (int refine : {0, 4})
      CHECK(test::largest_difference(
                surface(deformer, {motion, motion, places}, placed({0, 0, 1}, refine)), expected) <
            1e-6);
  }
}

TEST_CASE("handles that only place, and nothing else, are turned by where they go") {
  const test::Case tube = three_handles(false);
  Deformer deformer(tube.mesh, tube.roles, 3, {});
  const Positions centres = handle_centres(deformer.region(), tube.mesh.positions);
  const Affine turn = test::rotation_about(2.6, {0, 1, 0}, {0.3, 0, 2}, {0.4, -1, 2});
  std::vector<Affine> places;
  for (int h = 0; h < 3; ++h) {
    const Eigen::Vector3d from = centres.row(h), to = turn.leftCols<3>() * from + turn.col(3);
    places.push_back(moved(to.x() - from.x(), to.y() - from.y(), to.z() - from.z()));
  }
  CHECK(test::largest_difference(surface(deformer, places, placed({1, 1, 1})),
                                 test::transformed(turn, tube.mesh.positions)) < 1e-5);
}

TEST_CASE("a limb pulled by a hand that only places stretches as little as by the best turn",
          "[large]") {
  const test::Case limb = test::bent_cylinder();
  Deformer deformer(limb.mesh, limb.roles, 1, {});
  const Eigen::Vector3d centre =
      handle_centres(deformer.region(), limb.mesh.positions).row(0).transpose();
  const Eigen::Vector3d pulls[] = {{0.1, 0, 0}, {0.6, 0, -0.2}, {0.2, 0.85, -0.5}};
  for (const Eigen::Vector3d& pull : pulls) {
    const Affine motion = moved(pull.x(), pull.y(), pull.z());
    const Positions found = surface(deformer, {motion}, placed({1}));
    const Fit hand = fit(limb, 0, found);
    CHECK(hand.miss < 1e-9);
    const Eigen::Vector3d axis = Eigen::Vector3d::UnitZ().cross(pull).normalized();
    double best = 1;
    for (int degrees = 0; degrees <= 100; degrees += 4)
      best = std::min(
          best,
          stretch(limb, surface(deformer,
                                {test::rotation_about(test::radians(degrees), axis, centre, pull)},
                                test::usual())));
    INFO(pull.transpose());
    CHECK(stretch(limb, found) < 1.15 * best);
    CHECK(stretch(limb, found) < 0.65 * stretch(limb, surface(deformer, {motion}, test::usual())));
    // It turns in the plane of the pull.
    CHECK(rotation_vector(hand.rotation).normalized().dot(axis) > 0.999);
  }
}

TEST_CASE("the tip of a limb that is led aside turns, however thin the limb is") {
  for (const double solidity : {0.0, 1.0})
    for (const double radius : {0.3, 0.1, 0.03}) {
      const test::TaperedLimb limb(radius, radius);
      Deformer deformer(limb.mesh, limb.roles, 1, {});
      UpdateOptions options = placed({1});
      options.of_method.refined.solidity = solidity;
      std::vector<double> turns;
      const Affine motion = moved(0, 2, -1.2);
      const std::vector<double> found = deformer.completed_matrices(motion.data(), options, turns);
      INFO("radius " << radius << ", solidity " << solidity);
      // About x, by about twice the angle of the chord from where the limb is held, 42°.
      CHECK(std::atan2(-found[6], found[5]) < test::radians(-75));
      CHECK(std::atan2(-found[6], found[5]) > test::radians(-95));
    }
}

TEST_CASE("handles that only place don't depend on other loose parts") {
  // One tube is fixed and turned far, the other hangs on two free handles alone, and one vertex has
  // no triangle.
  const test::Case tube = three_handles(true);
  const int n = tube.mesh.vertex_count();
  Mesh mesh = test::appended(tube.mesh, tube.mesh);
  mesh.positions.conservativeResize(2 * n + 1, 3);
  mesh.positions.row(2 * n) << 1, 1, 1;
  std::vector<int> roles = tube.roles;
  for (int v = 0; v < n; ++v) {
    const double z = tube.mesh.positions(v, 2);
    roles.push_back(z < 0.3 ? 3 : z > 1.4 ? 4 : kFree);
  }
  roles.push_back(kFree);
  Deformer deformer(mesh, roles, 5, {});
  const Positions centres = handle_centres(deformer.region(), mesh.positions);
  const Affine turn = test::rotation_about(1.1, {0, 1, 0}, {0, 0, 0.5}, {0.2, 0, 0});
  for (double far : {0.0, 2.0, 3.1}) {
    std::vector<Affine> motions = {test::identity(),
                                   test::rotation_about(far, {0, 0, 1}, {0, 0, 0}, {0, 0, 0}),
                                   test::identity()};
    for (int h : {3, 4}) {
      const Eigen::Vector3d from = centres.row(h);
      const Eigen::Vector3d goes = turn.leftCols<3>() * from + turn.col(3) - from;
      motions.push_back(moved(goes.x(), goes.y(), goes.z()));
    }
    const Positions found = surface(deformer, motions, placed({0, 0, 1, 1, 1}));
    INFO(far);
    CHECK(test::largest_difference(found.middleRows(n, n),
                                   test::transformed(turn, tube.mesh.positions)) < 2e-4);
    CHECK((found.row(2 * n) - mesh.positions.row(2 * n)).norm() < 1e-12);
  }
}

TEST_CASE("a handle that only places keeps its pivot where it is told, in any unit") {
  for (double unit : {1.0, 1e-4, 1e4}) {
    test::Case limb = test::bent_cylinder();
    limb.mesh.positions *= unit;
    Deformer deformer(limb.mesh, limb.roles, 1, {});
    UpdateOptions options = placed({1});
    options.pivots = unit * Positions(Eigen::RowVector3d(0, 0, 1.44));  // the wrist
    const Positions found = surface(deformer, {moved(0.6 * unit, 0, -0.2 * unit)}, options) / unit;
    limb.mesh.positions /= unit;
    const Fit hand = fit(limb, 0, found);
    CHECK(hand.miss < 1e-7);
    for (size_t v = 0; v < limb.roles.size(); ++v) {
      if (limb.roles[v] != 0) continue;
      const Eigen::Vector3d rest =
          limb.mesh.positions.row(Index(v)).transpose() - Eigen::Vector3d(0, 0, 1.44);
      const Eigen::Vector3d expected = Eigen::Vector3d(0.6, 0, 1.24) + hand.rotation * rest;
      CHECK((found.row(Index(v)).transpose() - expected).norm() < 1e-6);
      break;
    }
    CHECK(rotation_vector(hand.rotation).norm() > 0.5);
  }
}

TEST_CASE(
    "a handle that only places turns half-way between the turns around it, past half a turn") {
  const test::Case tube = three_handles(true);
  Deformer deformer(tube.mesh, tube.roles, 3, {});
  for (double degrees : {60.0, 200.0, 360.0}) {
    INFO(degrees);
    UpdateOptions options = placed({0, 0, 1});
    const double angle = test::radians(degrees);
    options.turns = {0, 0, 0, 0, 0, angle, 0, 0, 0};
    const Affine twist = test::rotation_about(angle, {0, 0, 1}, {0, 0, 0}, {0, 0, 0});
    const Positions found = surface(deformer, {test::identity(), twist, test::identity()}, options);
    const Eigen::Vector3d turn = rotation_vector_near(
        Eigen::AngleAxisd(fit(tube, 2, found).rotation), Eigen::Vector3d(0, 0, angle / 2));
    CHECK(turn.z() == Approx(angle * (0.8 - 0.3) / (1.4 - 0.3)).epsilon(0.2));
    CHECK(turn.head<2>().norm() < 0.02);
  }
}

TEST_CASE("along a path the surface moves with a handle that only places, without jumps") {
  const test::Case limb = test::bent_cactus();
  Deformer deformer(limb.mesh, limb.roles, 1, {});
  constexpr int kMoves = 60;
  std::vector<Positions> on_the_way;
  const auto pull = [](int i) {
    const double t = i / double(kMoves);
    return Eigen::Vector3d(0.9 * t, 0.2 * std::sin(3 * t), -0.5 * t * t);
  };
  for (int i = 0; i <= kMoves; ++i) {
    const Eigen::Vector3d to = pull(i);
    on_the_way.push_back(surface(deformer, {moved(to.x(), to.y(), to.z())}, placed({1})));
    if (i == 0) {
      CHECK(test::largest_difference(on_the_way[0], limb.mesh.positions) < 1e-9);
      continue;
    }
    const double step = (on_the_way[i] - on_the_way[i - 1]).rowwise().norm().maxCoeff();
    CHECK(step < 3 * (to - pull(i - 1)).norm());
  }
  const Eigen::Vector3d middle = pull(kMoves / 2);
  CHECK(test::largest_difference(
            surface(deformer, {moved(middle.x(), middle.y(), middle.z())}, placed({1})),
            on_the_way[kMoves / 2]) < 1e-12);
}

TEST_CASE("handles of one vertex may only place, by every method") {
  test::Case limb = test::bent_cylinder();
  for (size_t v = 0; v < limb.roles.size(); ++v)
    if (limb.roles[v] == 0) limb.roles[v] = kFree;
  limb.roles[70 * 60] = 0;
  limb.roles[40 * 60 + 7] = 1;
  Deformer deformer(limb.mesh, limb.roles, 2, {});
  for (MethodKind method : {MethodKind::detail, MethodKind::variational, MethodKind::normal,
                            MethodKind::gradient, MethodKind::volumes, MethodKind::examples}) {
    UpdateOptions options = test::by(method);
    options.free = {1, 1};
    const Positions found = surface(deformer, {moved(0.2, 0, -0.05), moved(0.05, 0, 0)}, options);
    CHECK(found.allFinite());
    CHECK((found.row(70 * 60) - limb.mesh.positions.row(70 * 60))
              .isApprox(Eigen::RowVector3d(0.2, 0, -0.05), 1e-9));
    CHECK(test::largest_difference(surface(deformer, {test::identity(), test::identity()}, options),
                                   limb.mesh.positions) < 1e-9);
  }
}

TEST_CASE("on a base from outside a handle that only places turns as the base does there") {
  const test::Case tube = three_handles(true);
  BindOptions bind;
  bind.base = tube.mesh.positions;
  Deformer deformer(tube.mesh, tube.roles, 3, bind);
  const Affine turn = test::rotation_about(1.2, {0, 1, 0}, {0, 0, 0.1}, {0, 0, 0});
  const Positions base = test::transformed(turn, tube.mesh.positions);
  const Eigen::Vector3d centre =
      handle_centres(deformer.region(), tube.mesh.positions).row(1).transpose();
  const Eigen::Vector3d goes = turn.leftCols<3>() * centre + turn.col(3) - centre;
  std::vector<double> matrices;
  for (const Affine& motion :
       {test::identity(), moved(goes.x(), goes.y(), goes.z()), test::identity()})
    matrices.insert(matrices.end(), motion.data(), motion.data() + 12);
  const Positions found =
      tube.mesh.positions + deformer.update(matrices.data(), placed({0, 1, 0}), &base);
  for (Index v = 0; v < found.rows(); ++v)
    if (tube.roles[size_t(v)] == 1) CHECK((found.row(v) - base.row(v)).norm() < 1e-9);
}

TEST_CASE("EXAMPLES: a handle that only places reaches an example by its mean, and turns with it") {
  const test::ThreePoses poses;
  const Mesh& mesh = poses.limb.mesh;
  // Handles so large that their turn shows.
  std::vector<int> roles = poses.handles.roles;
  for (int v = 0; v < mesh.vertex_count(); ++v) {
    const double z = mesh.positions(v, 2);
    roles[v] = roles[v] == kFixed ? kFixed : z > 1.4 ? 0 : std::abs(z - 0.75) < 0.03 ? 1 : kFree;
  }
  for (Precision precision : {Precision::full, Precision::single}) {
    Deformer deformer(mesh, roles, 2, test::with(poses.examples, precision));
    const Positions centres = handle_centres(deformer.region(), mesh.positions);
    for (size_t i = 0; i < 3; ++i) {
      std::vector<Affine> motions;
      const Positions there = handle_centres(deformer.region(), poses.examples[i]);
      for (int h = 0; h < 2; ++h) {
        const Eigen::RowVector3d goes = there.row(h) - centres.row(h);
        motions.push_back(moved(goes.x(), goes.y(), goes.z()));
      }
      UpdateOptions options = test::posed();
      options.free = {1, 1};
      const Positions found = surface(deformer, motions, options);
      CHECK(test::largest_difference(found, poses.examples[i]) < 1e-3 * test::box(mesh));
      // The same places without the turn don't give the example.
      options.free = {};
      CHECK(test::largest_difference(surface(deformer, motions, options), poses.examples[i]) >
            1e-2 * test::box(mesh));
    }
  }
}

TEST_CASE("EXAMPLES: the means of handles that only place are met, of parts that float too") {
  const test::Limb limb(17, 8);
  const Mesh two = test::appended(limb.mesh, limb.mesh);
  Positions bent(two.vertex_count(), 3);
  bent << limb.bent(70, 0.6), limb.mesh.positions;
  // The first limb hangs on two free handles, one of which has a vertex of the second limb, too.
  std::vector<int> roles(size_t(two.vertex_count()), kFree);
  const int half = limb.mesh.vertex_count();
  for (int v = 0; v < half; ++v) {
    if (two.positions(v, 2) < 0.15) roles[v] = 0;
    if (two.positions(v, 2) > 1.45) roles[v] = 1;
    if (two.positions(v, 2) < 0.15) roles[half + v] = kFixed;
  }
  roles[half + 9 * 8] = 1;
  Deformer deformer(two, roles, 2, test::with({bent}));
  UpdateOptions options = test::posed();
  options.free = {1, 1};
  const Eigen::RowVector3d goes[] = {{0.1, 0.2, 0}, {0.5, 0.1, -0.2}};
  const Positions found = surface(deformer, {moved(0.1, 0.2, 0), moved(0.5, 0.1, -0.2)}, options);
  const Positions means =
      handle_centres(deformer.region(), found) - handle_centres(deformer.region(), two.positions);
  for (int h = 0; h < 2; ++h) CHECK((means.row(h) - goes[h]).norm() < 1e-9);
}

TEST_CASE("in steps a handle that only places takes the turn that it has in one") {
  const test::Case limb = test::bent_cylinder();
  Deformer deformer(limb.mesh, limb.roles, 1, {});
  const Affine motion = moved(0.6, 0, -0.2);
  const Fit at_once = fit(limb, 0, surface(deformer, {motion}, placed({1})));
  SplitMotion split{{motion.data(), motion.data() + 12}, 3};
  const Positions found =
      limb.mesh.positions + split_update(deformer, split, placed({1}, 0)).offsets;
  const Fit in_steps = fit(limb, 0, found);
  CHECK(in_steps.miss < 1e-6);
  CHECK((in_steps.rotation - at_once.rotation).cwiseAbs().maxCoeff() < 1e-6);
}
