// SPDX-License-Identifier: GPL-3.0-or-later
#include "base/motion_blend.h"

#include "cases.h"
#include "catch.h"
#include "deform.h"
#include "mesh/measures.h"
#include "support/rotations.h"

using namespace dd;
using test::Affine;
using test::surface;

namespace {

const double kTurn = 2 * std::acos(-1.0);

UpdateOptions blended(std::vector<double> turns = {}, int refine = 4) {
  UpdateOptions options = test::usual(refine);
  options.base_deformer = BaseDeformer::motions;
  options.turns = std::move(turns);
  return options;
}

/// A tube in three handles, with nothing fixed.
test::Case three_handles() {
  test::Case made = test::bent_cylinder();
  for (size_t v = 0; v < made.roles.size(); ++v) {
    const double z = made.mesh.positions(Index(v), 2);
    made.roles[v] = z < 0.2 ? 0 : z > 1.4 ? 1 : std::abs(z - 0.8) < 0.05 ? 2 : kFree;
  }
  return made;
}

/// The bar's end turned about its axis.
Affine twist(double angle) { return test::rotation_about(angle, {0, 0, 1}, {0, 0, 0}, {0, 0, 0}); }

/// The largest twist between neighbouring twentieths of the free length, over an even twist's.
double largest_rate(const test::Case& bar, const Positions& deformed, double angle) {
  constexpr int kSlabs = 20;
  double cosine[kSlabs] = {}, sine[kSlabs] = {};
  const double low = 0.1 * 1.2, high = 0.9 * 1.2;
  for (int v = 0; v < bar.mesh.vertex_count(); ++v) {
    const Eigen::RowVector3d p = bar.mesh.positions.row(v), q = deformed.row(v);
    const double place = (p.z() - low) / (high - low);
    if (place <= 0 || place >= 1) continue;
    const int slab = static_cast<int>(place * kSlabs);
    cosine[slab] += p.x() * q.x() + p.y() * q.y();
    sine[slab] += p.x() * q.y() - p.y() * q.x();
  }
  double largest = 0;
  for (int k = 1; k < kSlabs; ++k) {
    const double step = std::atan2(sine[k], cosine[k]) - std::atan2(sine[k - 1], cosine[k - 1]);
    largest = std::max(largest, std::abs(std::remainder(step, kTurn)));
  }
  return largest * kSlabs / angle;
}

int intersecting(const test::Case& one, const Positions& deformed) {
  std::vector<char> free;
  for (int role : one.roles) free.push_back(role == kFree);
  return measure(one.mesh, deformed, free).intersecting_triangles;
}

}  // namespace

TEST_CASE("blended motions: a rigid motion of all handles is exact, with any number of turns") {
  const test::Case tube = three_handles();
  Deformer deformer(tube.mesh, tube.roles, 3, {});
  const Eigen::Vector3d axis = Eigen::Vector3d(1, 2, -0.5).normalized();
  for (double angle : {0.0, 1e-9, 0.5, 2.5, 3.5, 5.5, 0.999 * kTurn, kTurn, 2.3 * kTurn}) {
    INFO(angle);
    const Affine motion = test::rotation_about(angle, axis, {0.3, 0, 2}, {0.4, -1, 2});
    const Eigen::Vector3d turn = angle * axis;
    std::vector<double> turns;
    for (int h = 0; h < 3; ++h) turns.insert(turns.end(), turn.data(), turn.data() + 3);
    const Positions expected = test::transformed(motion, tube.mesh.positions);
    for (int refine : {0, 4})
      CHECK(test::largest_difference(
                surface(deformer, {motion, motion, motion}, blended(turns, refine)), expected) <
            1e-8);
  }
}

TEST_CASE("blended motions: translations and small turns move the base as the linear one does") {
  const test::Case tube = three_handles();
  Deformer deformer(tube.mesh, tube.roles, 3, {});
  const auto base = [&](const std::vector<Affine>& motions, BaseDeformer kind) {
    UpdateOptions options = test::shown_base();
    options.base_deformer = kind;
    return surface(deformer, motions, options);
  };
  Affine shift = test::identity(), other = test::identity();
  shift.col(3) << 0.3, -0.2, 0.5;
  other.col(3) << -0.1, 0.4, 0;
  const std::vector<Affine> shifts = {shift, test::identity(), other};
  CHECK(test::largest_difference(base(shifts, BaseDeformer::motions),
                                 base(shifts, BaseDeformer::linear)) < 1e-12);
  // The difference is of second order: half of the angle, a quarter of it.
  double last = 0;
  for (double angle : {0.1, 0.05}) {
    const std::vector<Affine> motions = {
        test::rotation_about(angle, {0, 1, 0}, {0, 0, 0}, {0, 0, 0}), test::identity(),
        test::rotation_about(-angle, {1, 1, 0}, {0, 0.3, 1}, {0, 0, 0})};
    const double difference = test::largest_difference(base(motions, BaseDeformer::motions),
                                                       base(motions, BaseDeformer::linear));
    if (angle < 0.1) CHECK(difference < 0.27 * last);
    last = difference;
  }
  // `automatic` is the linear base up to 135 degrees, and then goes over to motions until 180.
  const auto bend = [&](double degrees, BaseDeformer kind) {
    return base({test::bend(degrees, 0.3, 0.8), test::identity(), test::identity()}, kind);
  };
  CHECK(test::largest_difference(bend(134, BaseDeformer::automatic),
                                 bend(134, BaseDeformer::linear)) == 0);
  CHECK(test::largest_difference(bend(179.999, BaseDeformer::automatic),
                                 bend(179.999, BaseDeformer::motions)) < 1e-4);
}

TEST_CASE("blended motions: the automatic share goes by the largest angle between two handles") {
  const Mesh mesh = test::rough_sphere(3, 0.1);
  std::vector<int> roles(size_t(mesh.vertex_count()), kFree);
  constexpr int kCount = 40;
  for (int h = 0; h < kCount; ++h) roles[roles.size() / kCount * size_t(h)] = h;
  const Region region = make_region(mesh, roles, kCount);
  ThreadPool pool(1);
  const BoundSurface bound(mesh, region, {}, pool, {});
  MotionBlend blend(bound);
  std::srand(11);
  for (const double common : {0.0, 0.4})  // all turned alike, too
    for (const double spread : {0.0, 0.45, 0.5, 0.55, 0.6}) {
      std::vector<MotionBlend::Affine> motions;
      std::vector<Eigen::Vector3d> angles;
      for (int h = 0; h < kCount; ++h) {
        const Eigen::Vector3d axis = Eigen::Vector3d::Random().normalized();
        // Alternating turns, so that several handles are equally far from the mean.
        const Eigen::Vector3d angle =
            Eigen::Vector3d(0, 0, common) + kTurn / 2 * spread * (h % 2 ? -1 : 1) * axis;
        angles.push_back(angle);
        MotionBlend::Affine motion = MotionBlend::Affine::Zero();
        motion.leftCols<3>() = rotation_by(angle);
        motions.push_back(motion);
      }
      blend.set_pose(motions, {});
      // Nothing is fixed: rotations count relative to the first handle's.
      double farthest = 0;
      const auto to_first = [&](int h) -> Eigen::Vector3d {
        return rotation_vector(rotation_by(angles[0]).transpose() * rotation_by(angles[size_t(h)]));
      };
      for (int i = 0; i < kCount; ++i)
        for (int j = 0; j < i; ++j)
          farthest = std::max(farthest, (to_first(i) - to_first(j)).norm());
      const double half = kTurn / 2;
      CHECK(blend.blend_fraction(BaseDeformer::automatic) ==
            Approx(std::clamp((farthest - 0.75 * half) / (0.25 * half), 0.0, 1.0)).margin(1e-9));
    }
}

TEST_CASE(
    "blended motions: handles are in their places with mirrored, sheared and singular matrices") {
  const test::Case tube = three_handles();
  Deformer deformer(tube.mesh, tube.roles, 3, {});
  Affine mirrored = test::identity(), sheared = twist(4), flat = test::identity();
  mirrored(0, 0) = -1;
  sheared(0, 1) += 0.7;
  sheared(2, 2) = 3;
  flat(1, 1) = 0;
  const std::vector<Affine> motions = {mirrored, sheared, flat};
  const Positions result = surface(deformer, motions, blended());
  CHECK(result.allFinite());
  const double box = 1.6;
  CHECK((result - tube.mesh.positions).rowwise().norm().maxCoeff() < 3 * box);
  // The base of a handle moves by its matrix, too.
  UpdateOptions shown = blended();
  shown.output = Output::base;
  const Positions base = surface(deformer, motions, shown);
  for (int v = 0; v < tube.mesh.vertex_count(); ++v)
    if (tube.roles[v] >= 0) {
      const Affine& motion = motions[size_t(tube.roles[v])];
      CHECK((result.row(v) - test::transformed(motion, tube.mesh.positions.row(v))).norm() < 1e-12);
      CHECK((base.row(v) - test::transformed(motion, deformer.base().row(v))).norm() < 1e-12);
    }
  const double nan = std::nan("");
  CHECK(test::refusal([&] { surface(deformer, motions, blended({0, 0, 0, nan, 0, 0, 0, 0, 0})); },
                      Status::argument)
            .find("Handle 1") != std::string::npos);
}

TEST_CASE("blended motions: an arc is the same after any pose, and after one that was refused") {
  const test::Case tube = test::bent_cylinder();
  const UpdateOptions options = blended({}, 0);
  Deformer fresh(tube.mesh, tube.roles, 1, {});
  const Positions expected = surface(fresh, {tube.motion}, options);
  Deformer used(tube.mesh, tube.roles, 1, {});
  surface(used, {twist(2)}, options);
  CHECK(test::largest_difference(surface(used, {tube.motion}, options), expected) == 0);
  for (double angle : {0.0, 0.5})
    for (const UpdateOptions& any : {options, test::usual(), blended()}) {
      Affine far = twist(angle);
      far.col(3).setConstant(1.7e308);
      CHECK_THROWS_AS(surface(used, {far}, any), Error);
      CHECK(test::largest_difference(surface(used, {tube.motion}, options), expected) == 0);
    }
}

TEST_CASE("a bar twisted by one turn and by two, in one step: even, and without a fold") {
  const test::Case bar = test::twisted_bar();
  Deformer deformer(bar.mesh, bar.roles, 1, {});
  UpdateOptions options = test::usual();
  for (double turns : {0.5, 1.0, 2.0}) {
    INFO(turns);
    const double angle = turns * kTurn;
    options.turns = {0, 0, angle};
    const Positions result = surface(deformer, {twist(angle)}, options);
    CHECK(intersecting(bar, result) == 0);
    CHECK(largest_rate(bar, result, angle) < 1.3);
  }
}

TEST_CASE("a cylinder bent along an arc of its own length, in one step") {
  const test::Case tube = test::bent_cylinder();
  Deformer deformer(tube.mesh, tube.roles, 1, {});
  const std::vector<char> all(tube.roles.size(), 1);  // published figures count all triangles
  const double low = 0.16, length = 1.44 - low;
  const struct {
    double degrees, stretch;
  } bends[] = {{150, 0.13}, {200, 0.17}, {270, 0.2}};
  for (const auto& [degrees, most] : bends) {
    INFO(degrees);
    const double angle = test::radians(degrees), radius = length / angle;
    Affine motion = test::rotation_about(angle, {0, 1, 0}, {radius, 0, low}, {0, 0, 0});
    motion.col(3) -= length * motion.col(2);
    UpdateOptions options = test::usual();
    options.turns = {0, angle, 0};
    const Measures found = measure(tube.mesh, surface(deformer, {motion}, options), all);
    CHECK(found.new_intersecting_pairs == 0);
    CHECK(found.stretch < most);
  }
}

TEST_CASE("the result depends on the pose alone, and turning beyond whole turns has no jumps") {
  const test::Case bar = test::twisted_bar();
  Deformer deformer(bar.mesh, bar.roles, 1, {});
  UpdateOptions options = test::usual();
  constexpr int kMoves = 200;
  const double farthest = 1.3 * kTurn;
  const auto at = [&](int k) {
    const double angle = farthest * k / kMoves;
    // Moved sideways as well, which no screw motion does at a whole turn.
    Affine motion = twist(angle);
    motion(0, 3) = 0.2 * k / kMoves;
    options.turns = {0, 0, angle};
    return surface(deformer, {motion}, options);
  };
  Positions last = bar.mesh.positions;
  for (int k = 1; k <= kMoves; ++k) {
    const Positions now = at(k);
    double handle = 0, all = 0;
    for (int v = 0; v < bar.mesh.vertex_count(); ++v) {
      const double moved = (now.row(v) - last.row(v)).norm();
      all = std::max(all, moved);
      if (bar.roles[v] == 0) handle = std::max(handle, moved);
    }
    CHECK(all < 3 * handle);
    last = now;
  }
  Deformer fresh(bar.mesh, bar.roles, 1, {});
  const double angle = farthest;
  Affine motion = twist(angle);
  motion(0, 3) = 0.2;
  options.turns = {0, 0, angle};
  CHECK(test::largest_difference(surface(fresh, {motion}, options), last) == 0);
}
