// SPDX-License-Identifier: GPL-3.0-or-later
// Progress of every kind of job: from 0 to 1, never falling.
#include <algorithm>
#include <vector>

#include "cases.h"
#include "catch.h"
#include "deform.h"
#include "deform/split_motion.h"
#include "match/registration.h"
#include "match/triangle_match.h"

using namespace dd;
using test::by;

namespace {

/// The progress that a job reports.
struct Told {
  std::vector<double> fractions;

  Progress listener() {
    return [this](double fraction, Stage stage) {
      fractions.push_back(stage <= Stage::done ? fraction : -1);
      return true;
    };
  }
  bool rises() const {
    return !fractions.empty() && std::is_sorted(fractions.begin(), fractions.end()) &&
           fractions.front() >= 0 && fractions.back() <= 1;
  }
};

/// Checks the progress of a whole job. least: of how many reports.
void check_from_start_to_end(const Told& told, size_t least = 3) {
  CHECK(told.fractions.size() >= least);
  CHECK(told.rises());
  CHECK(told.fractions.front() < 0.1);
  CHECK(told.fractions.back() == 1);
}

BindOptions bind_options(BaseMetric metric, double smoothing, Precision precision) {
  BindOptions options;
  options.base_metric = metric;
  options.metric_smoothing = smoothing;
  options.precision = precision;
  options.threads = 2;
  return options;
}

}  // namespace

TEST_CASE("the progress of a bind never falls, with any options") {
  const test::Case plane = test::lifted_plane(81);
  std::vector<BindOptions> binds = {
      bind_options(BaseMetric::surface, 0, Precision::single),
      bind_options(BaseMetric::surface, 1, Precision::full),
      bind_options(BaseMetric::base, 0, Precision::single),
      bind_options(BaseMetric::base, 0, Precision::full),
  };
  binds.push_back(binds[0]);
  binds.back().base = plane.mesh.positions;
  for (const BindOptions& options : binds) {
    Told told;
    Deformer(plane.mesh, plane.roles, 1, options, told.listener());
    check_from_start_to_end(told);
  }
}

TEST_CASE("the progress of a motion in steps never falls, by any method") {
  test::Case plane = test::lifted_plane(41);
  plane.motion = test::rotation_about(1.2, {0, 1, 0.2}, {0.9, 0.5, 0}, {0, 0, 0.4});
  // A large turn, for which some steps of VOLUMES change more than those before them.
  test::Case ball = {"ball", test::rough_sphere(3, 0.05), {}, {}};
  ball.roles = test::roles_by_height(ball.mesh, -0.6, 0.6);
  ball.motion = test::rotation_about(2.9, {0.3, 1, 0.2}, {0, 0, 0.5}, {0.1, 0, 0});
  for (const test::Case& one : {plane, ball})
    for (MethodKind method : {MethodKind::detail, MethodKind::variational, MethodKind::normal,
                              MethodKind::gradient, MethodKind::volumes, MethodKind::examples})
      for (int steps : {1, 3}) {
        if (method == MethodKind::examples && steps > 1) continue;
        SplitMotion motion;
        motion.matrices.assign(one.motion.data(), one.motion.data() + 12);
        motion.steps = steps;
        Told told;
        INFO(one.name << " by method " << static_cast<int>(method) << ", steps " << steps);
        Deformer deformer(one.mesh, one.roles, 1, {});
        split_update(deformer, motion, by(method), told.listener());
        // One step of a quick method is a frame, with a report before and after.
        check_from_start_to_end(told, steps > 1 || method == MethodKind::volumes ? 3 : 2);
      }
}

TEST_CASE("the progress of a match never falls") {
  const Mesh source = test::sphere(3);
  const Mesh target = test::rough_sphere(4, 0.1);
  Told fitting, looking;
  const Positions fitted =
      register_onto(source, target, {{0, 0}, {2, 2}, {4, 4}}, {}, fitting.listener());
  check_from_start_to_end(fitting);
  match_triangles({fitted, source.triangles}, target, 0.1, 2, looking.listener());
  check_from_start_to_end(looking);
}

TEST_CASE("progress doesn't fall where single precision is tried in vain") {
  // A strip too long for single precision, held at one end.
  const int length = 80001;
  const Mesh strip =
      test::grid(length, 3, [](double x, double) { return 0.01 * std::sin(60 * x); });
  const Region region = make_region(strip, test::strip_roles(length, 3, 0, length - 1), 1);
  const auto operators = surface_operators(strip.positions, strip.triangles);
  ThreadPool pool(2);
  Told told;
  BlockOptions options;
  options.pool = &pool;
  options.precision = Precision::single;
  options.progress = told.listener();
  const SparseMatrix block = free_block(operators.laplacian, region);
  const Dissection dissection = free_dissection(block, region, strip.positions);
  options.dissection = &dissection;
  const PoissonSystem system(strip, region, operators, block, options);
  REQUIRE(system.precision() == Precision::full);
  CHECK(told.rises());
}
