// SPDX-License-Identifier: GPL-3.0-or-later
#include "deform/split_motion.h"

#include <Eigen/Dense>

#include "cases.h"
#include "catch.h"
#include "deform.h"
#include "mesh/measures.h"

using namespace dd;
using test::Affine;
using test::by;

namespace {

SplitMotion in_steps(const Affine& matrix, int steps) {
  SplitMotion motion;
  motion.matrices.assign(matrix.data(), matrix.data() + 12);
  motion.steps = steps;
  return motion;
}

Positions split(const test::Case& one, int steps, UpdateOptions update = by(MethodKind::detail),
                const Eigen::Vector3d& turn = Eigen::Vector3d::Zero()) {
  const SplitMotion motion = in_steps(one.motion, steps);
  update.turns.assign(turn.data(), turn.data() + 3);
  Deformer deformer(one.mesh, one.roles, 1, {});
  return one.mesh.positions + split_update(deformer, motion, update).offsets;
}

Affine after(const ScrewMotion& screw, double s) { return screw.at(s); }

Eigen::Matrix4d square(const Affine& matrix) {
  Eigen::Matrix4d result = Eigen::Matrix4d::Identity();
  result.topRows<3>() = matrix;
  return result;
}

}  // namespace

TEST_CASE("a rigid motion's parts are powers of it: M(s) M(t) = M(s + t)") {
  const Affine motion = test::rotation_about(2.2, {1, 2, -1}, {3, 0, 1}, {0.5, -1, 2});
  const ScrewMotion screw(motion, {0.3, 0.2, 0.1}, Eigen::Vector3d::Zero());
  CHECK((after(screw, 0) - test::identity()).norm() < 1e-12);
  CHECK((after(screw, 1) - motion).norm() < 1e-12);
  CHECK((square(after(screw, 0.3)) * square(after(screw, 0.5)) - square(after(screw, 0.8))).norm() <
        1e-12);
  const Eigen::Matrix4d third = square(after(screw, 1.0 / 3));
  CHECK((third * third * third - square(motion)).norm() < 1e-12);
}

TEST_CASE("translations go straight, stretches grow linearly, turns may be asked for whole") {
  Affine shift = test::identity();
  shift.col(3) << 1, 2, 3;
  CHECK((after(ScrewMotion(shift, {5, 5, 5}, Eigen::Vector3d::Zero()), 0.25).col(3) -
         0.25 * shift.col(3))
            .norm() < 1e-12);
  Affine scale = test::identity();
  scale.leftCols<3>() *= 3;
  CHECK((after(ScrewMotion(scale, {0, 0, 0}, Eigen::Vector3d::Zero()), 0.5).leftCols<3>() -
         2 * Eigen::Matrix3d::Identity())
            .norm() < 1e-12);
  // Once around about z: the end is the identity, the middle half a turn.
  const double turn = 2 * std::acos(-1.0);
  const ScrewMotion whole(test::identity(), {1, 0, 0}, {0, 0, turn});
  CHECK((after(whole, 0.5).leftCols<3>() -
         Eigen::AngleAxisd(turn / 2, Eigen::Vector3d::UnitZ()).toRotationMatrix())
            .norm() < 1e-12);
  // 240 degrees the long way, where the shortest would be −120.
  const Affine two_thirds = test::rotation_about(turn * 2 / 3, {0, 0, 1}, {1, 0, 0}, {0, 0, 0});
  const ScrewMotion far(two_thirds, {2, 0, 0}, {0, 0, turn * 0.6});
  CHECK((after(far, 0.5) - test::rotation_about(turn / 3, {0, 0, 1}, {1, 0, 0}, {0, 0, 0})).norm() <
        1e-12);
  Affine mirror = test::identity();
  mirror(0, 0) = -1;
  CHECK_THROWS_AS(ScrewMotion(mirror, {0, 0, 0}, Eigen::Vector3d::Zero()), Error);
}

TEST_CASE("one step is the plain update, resting handles give rest in any number") {
  auto one = test::bent_cactus();
  Deformer deformer(one.mesh, one.roles, 1, {});
  const Positions plain = test::surface(deformer, {one.motion}, by(MethodKind::detail, true, 2));
  CHECK(test::largest_difference(split(one, 1, by(MethodKind::detail, true, 2)), plain) == 0);
  one.motion = test::identity();
  CHECK(test::largest_difference(split(one, 3), one.mesh.positions) < 1e-9);
}

TEST_CASE("the result converges as steps grow", "[large]") {
  const auto one = test::bent_cylinder(120);
  const Positions two = split(one, 2), four = split(one, 4), eight = split(one, 8),
                  sixteen = split(one, 16);
  const double first = (four - two).norm(), second = (eight - four).norm(),
               third = (sixteen - eight).norm();
  INFO(first << " " << second << " " << third);
  CHECK(second < 0.7 * first);
  CHECK(third < 0.7 * second);
}

/// The angle by which a twisted bar is wound from end to end, followed from ring to ring.
static double winding(const Mesh& bar, const Positions& wound) {
  const int sides = 96, rings = 61;
  double last = 0, turned = 0;
  for (int ring = 0; ring < rings; ++ring) {
    double sine = 0, cosine = 0;
    for (int k = 0; k < sides; ++k) {
      const Eigen::RowVector3d p = bar.positions.row(ring * sides + k),
                               q = wound.row(ring * sides + k);
      cosine += p.head<2>().dot(q.head<2>());
      sine += p[0] * q[1] - p[1] * q[0];
    }
    const double angle = std::atan2(sine, cosine);
    turned += std::remainder(angle - last, 2 * std::acos(-1.0));
    last = angle;
  }
  return turned;
}

TEST_CASE("two turns arrive whole in two and in three steps, each of which turns by 180° or more") {
  auto bar = test::twisted_bar();
  bar.motion = test::identity();
  const double turns = 4 * std::acos(-1.0);
  for (int steps : {2, 3})
    CHECK(winding(bar.mesh, split(bar, steps, by(MethodKind::detail, true, 0), {0, 0, turns})) ==
          Approx(turns).epsilon(1e-6));
}

TEST_CASE("120 degrees and back in 12 steps each returns to rest: the hysteresis is small",
          "[large]") {
  auto one = test::bent_cylinder(120);
  const Mesh rest = one.mesh;
  one.mesh.positions = split(one, 12);
  Affine back;
  back = Eigen::Matrix4d(square(one.motion).inverse()).topRows<3>();
  one.motion = back;
  const double missed = (split(one, 12) - rest.positions).rowwise().norm().maxCoeff() /
                        bounding_box_diagonal(rest.positions);
  INFO("hysteresis of 120 degrees and back, 12 steps each, of the box: " << missed);
  CHECK(missed < 1.1e-2);
}

TEST_CASE("a whole turn in steps winds a bar once around, forwards everywhere and not in one place",
          "[large]") {
  auto bar = test::twisted_bar();
  bar.motion = test::identity();
  const Positions wound =
      split(bar, 12, by(MethodKind::detail, true, 4), {0, 0, 2 * std::acos(-1.0)});
  // The angle of each ring about the axis, followed upwards.
  const int sides = 96, rings = 61;
  double last = 0, turned = 0, largest = 0;
  for (int ring = 0; ring < rings; ++ring) {
    double sine = 0, cosine = 0;
    for (int k = 0; k < sides; ++k) {
      const Eigen::RowVector3d p = bar.mesh.positions.row(ring * sides + k),
                               q = wound.row(ring * sides + k);
      cosine += p.head<2>().dot(q.head<2>());
      sine += p[0] * q[1] - p[1] * q[0];
    }
    const double angle = std::atan2(sine, cosine);
    const double step = std::remainder(angle - last, 2 * std::acos(-1.0));
    CHECK(step > -1e-6);
    turned += step;
    largest = std::max(largest, step);
    last = angle;
  }
  CHECK(turned == Approx(2 * std::acos(-1.0)).epsilon(1e-6));
  // An even twist turns by 2π / 49 from each of the free rings to the next. Each step twists most
  // in the middle, where the steps before it have made the bar thinner and softer.
  CHECK(largest < 3.6 * 2 * std::acos(-1.0) / 49);
  std::vector<char> free;
  for (int role : bar.roles) free.push_back(role == kFree);
  CHECK(measure(bar.mesh, wound, free).intersecting_pairs == 0);
}

TEST_CASE("a split refuses with the handle or the step, and can be cancelled") {
  auto one = test::bent_cactus();
  one.motion.leftCols<3>().setZero();
  CHECK_THAT(test::refusal([&] { split(one, 3); }, Status::argument), contains("Handle 0"));
  const SplitMotion motion = in_steps(test::bend(70, 0, 0.7), 4);
  Deformer deformer(one.mesh, one.roles, 1, {});
  std::vector<double> fractions;
  split_update(deformer, motion, {}, [&](double fraction, Stage) {
    fractions.push_back(fraction);
    return true;
  });
  CHECK(std::is_sorted(fractions.begin(), fractions.end()));
  CHECK(fractions.back() == 1);
  int calls = 0;
  CHECK_THAT(
      test::refusal(
          [&] { split_update(deformer, motion, {}, [&](double, Stage) { return ++calls < 9; }); },
          Status::cancelled),
      contains("cancelled"));
}

TEST_CASE("steps begin at rest whatever the deformer was used for before, and release it early",
          "[large]") {
  const auto one = test::bent_cactus();
  const auto volumes = by(MethodKind::volumes), refined = by(MethodKind::detail, true, 4);
  Deformer used(one.mesh, one.roles, 1, {});
  for (const UpdateOptions& before : {volumes, refined, by(MethodKind::normal)})
    test::surface(used, {test::bend(40, 0, 0.3)}, before);
  for (const UpdateOptions& options : {refined, volumes})
    for (int steps : {1, 2, 3}) {
      Deformer fresh(one.mesh, one.roles, 1, {});
      const SplitMotion motion = in_steps(one.motion, steps);
      const SplitResult expected = split_update(fresh, motion, options);
      int released = 0;
      Positions meanwhile;
      const SplitResult found = split_update(used, motion, options, {}, nullptr, [&] {
        ++released;
        meanwhile = test::surface(used, {test::bend(-30, 0, 0.3)}, refined);
      });
      CHECK((found.offsets.array() == expected.offsets.array()).all());
      CHECK(found.volume_error == expected.volume_error);
      CHECK(found.volumes_converged == expected.volumes_converged);
      CHECK(released == 1);
      CHECK((meanwhile.array() == test::surface(fresh, {test::bend(-30, 0, 0.3)}, refined).array())
                .all());
    }
  CHECK(split_update(used, in_steps(one.motion, 1), refined).volume_error == 0);
}

TEST_CASE("displacement volumes can be stopped in the midst of a step, which leaves no trace") {
  const auto one = test::bent_cactus();
  UpdateOptions options = by(MethodKind::volumes);
  options.of_method.volume_iterations = 1;
  const SplitMotion motion = in_steps(one.motion, 1);
  Deformer fresh(one.mesh, one.roles, 1, {});
  int calls = 0;
  std::vector<double> fractions;
  const Positions whole = split_update(fresh, motion, options, [&](double fraction, Stage) {
                            ++calls;
                            fractions.push_back(fraction);
                            return true;
                          }).offsets;
  CHECK(std::is_sorted(fractions.begin(), fractions.end()));
  CHECK(calls > 10);  // one Gauss-Newton step has tens of rounds
  Deformer stopped(one.mesh, one.roles, 1, {});
  for (int last : {1, 2, calls / 4, calls / 2}) {
    int left = last;
    const auto stop = [&](double, Stage) { return --left > 0; };
    CHECK_THAT(
        test::refusal([&] { split_update(stopped, motion, options, stop); }, Status::cancelled),
        contains("cancelled"));
  }
  CHECK((split_update(stopped, motion, options).offsets.array() == whole.array()).all());
}
