// SPDX-License-Identifier: GPL-3.0-or-later
// Surfaces that are stiffer in some parts than in others.
#include "systems/stiffness.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <functional>
#include <map>
#include <numeric>
#include <random>

#include "catch.h"
#include "deform.h"
#include "deform/draft.h"
#include "deform/split_motion.h"
#include "limbs.h"
#include "mesh/measures.h"
#include "reconstruction/coarse/coarse_surface.h"
#include "tapered_limb.h"

using namespace dd;
using namespace dd::test;

namespace {

BindOptions with_weights(const Eigen::VectorXf& weights) {
  BindOptions options;
  options.stiffness = weights;
  return options;
}

Eigen::VectorXf weights_of(const Mesh& mesh,
                           const std::function<double(const Eigen::RowVector3d&)>& weight) {
  Eigen::VectorXf weights(mesh.vertex_count());
  for (int v = 0; v < mesh.vertex_count(); ++v)
    weights[v] = static_cast<float>(weight(mesh.positions.row(v)));
  return weights;
}

std::vector<int> where(const Eigen::VectorXf& weights, float at_least) {
  std::vector<int> found;
  for (Index v = 0; v < weights.size(); ++v)
    if (weights[v] >= at_least) found.push_back(static_cast<int>(v));
  return found;
}

/// A plate on the limb's side, a fifth of its length and a third of its girth.
constexpr double kPlateLength = 0.2 * TaperedLimb::kLength;
double in_plate(const Eigen::RowVector3d& x) {
  return std::abs(x[2] - 0.5 * TaperedLimb::kLength) < 0.5 * kPlateLength &&
         std::abs(std::atan2(x[1], x[0]) + kPi / 2) < 1;
}

/// The rigid motion that fits these vertices best.
Affine rigid_fit(const Positions& rest, const Positions& p, const std::vector<int>& vertices) {
  const Positions before = rest(vertices, kAllIndices), after = p(vertices, kAllIndices);
  const Eigen::Matrix4d motion = Eigen::umeyama(before.transpose(), after.transpose(), false);
  return motion.topRows<3>();
}

double off_rigid(const Positions& rest, const Positions& p, const std::vector<int>& vertices) {
  const Positions moved = transformed(rigid_fit(rest, p, vertices), rest);
  double farthest = 0;
  for (int v : vertices) farthest = std::max(farthest, (p.row(v) - moved.row(v)).norm());
  return farthest;
}

struct Pose {
  Affine motion;
  Eigen::Vector3d turn;
};
const Pose kBent{TaperedLimb::bend(90), {0, radians(90), 0}};
const Pose kTwisted{TaperedLimb::twist(90), {0, 0, radians(90)}};
const Pose kLed{TaperedLimb::led_down(), {0, 0, 0}};

}  // namespace

TEST_CASE("stiffness: L and div are those of the integral of k |grad x|^2, M of the area") {
  const Mesh mesh = rough_sphere(2, 0.2);
  std::mt19937 random(1);
  Eigen::VectorXf weights = weights_of(
      mesh, [&](const auto&) { return std::uniform_real_distribution<float>()(random); });
  weights[7] = 0;
  std::vector<int> roles(size_t(mesh.vertex_count()), kFree), all(roles.size());
  for (int v : {3, 4, 5}) roles[size_t(v)] = 0;
  std::iota(all.begin(), all.end(), 0);  // each merged into itself
  const Region region = region_of_roles(roles, 1);
  const Stiffness of_surface(weights, region);
  for (const bool coarse : {false, true}) {
    const Stiffness stiffness = coarse ? of_surface.of_coarse(all, region) : of_surface;
    const SurfaceOperators made =
        stiffened(surface_operators(mesh.positions, mesh.triangles), stiffness);
    const TriangleMetric metric = triangle_metric(mesh.positions, mesh.triangles);
    const SparseMatrix G = gradient(mesh.positions, mesh.triangles);
    Eigen::VectorXd factors(3 * mesh.triangle_count());
    for (int j = 0; j < mesh.triangle_count(); ++j) {
      std::vector<float> of_free;
      for (int v : mesh.triangles.row(j))
        if (roles[size_t(v)] == kFree) of_free.push_back(weights[v]);
      if (of_free.empty()) of_free = {0};
      const auto [least, most] = std::minmax_element(of_free.begin(), of_free.end());
      factors.segment<3>(3 * j).setConstant(metric.areas[j] *
                                            std::pow(1e4, double(coarse ? *most : *least)));
    }
    const Eigen::MatrixXd expected = G.transpose() * factors.asDiagonal() * Eigen::MatrixXd(G);
    CHECK((Eigen::MatrixXd(made.laplacian) - expected).cwiseAbs().maxCoeff() <
          1e-12 * expected.maxCoeff());
    const Positions flux = corner_divergence(made.metric, mesh.positions, mesh.triangles);
    Positions sums = Positions::Zero(mesh.vertex_count(), 3);
    for (int j = 0; j < mesh.triangle_count(); ++j)
      for (int k = 0; k < 3; ++k) sums.row(mesh.triangles(j, k)) += flux.row(3 * j + k);
    CHECK(largest_difference(sums, made.laplacian * mesh.positions) < 1e-9);
    CHECK(made.masses == mixed_voronoi_masses(metric, mesh.triangles, mesh.vertex_count()));
  }
}

TEST_CASE("stiffness: a rigid plate keeps its shape while its limb is bent, twisted, led aside") {
  for (const int density : {1, 3})
    for (const double relief : {0.0, 0.08}) {
      const TaperedLimb limb(0.4, 0.4, 1, density, relief);
      const Eigen::VectorXf weights = weights_of(limb.mesh, in_plate);
      const std::vector<int> plate = where(weights, 1);
      Deformer soft(limb.mesh, limb.roles, 1, {}),
          stiff(limb.mesh, limb.roles, 1, with_weights(weights));
      for (const Pose& pose : {kBent, kTwisted, kLed}) {
        INFO("density " << density << ", relief " << relief << ", turn " << pose.turn.transpose());
        const Positions before = surface(soft, {pose.motion}, solid(1, pose.turn)),
                        p = surface(stiff, {pose.motion}, solid(1, pose.turn));
        CHECK(off_rigid(limb.mesh.positions, before, plate) > 0.04 * kPlateLength);
        CHECK(off_rigid(limb.mesh.positions, p, plate) < 3e-4 * kPlateLength);
        CHECK(off_rigid(limb.mesh.positions, surface(stiff, {pose.motion}, solid(0, pose.turn)),
                        plate) < 4e-3 * kPlateLength);
        CHECK(limb.least_section(p) > 0.88);
        CHECK(
            measure(limb.mesh, p, std::vector<char>(limb.roles.size(), 1)).new_intersecting_pairs ==
            0);
      }
    }
}

TEST_CASE("stiffness: a plate of a skin stays rigid with more passes, and in either precision") {
  const Case sheet = lifted_plane(61);
  const Affine turned = rotation_about(radians(60), {0, 1, 0}, {0.5, 0, 0}, {0, 0, 0.2});
  BindOptions options = with_weights(weights_of(sheet.mesh, [](const Eigen::RowVector3d& x) {
    return std::abs(x[0] - 0.5) < 0.1 && std::abs(x[1] - 0.5) < 0.2;
  }));
  const std::vector<int> patch = where(options.stiffness, 1);
  for (const Precision precision : {Precision::single, Precision::full}) {
    options.precision = precision;
    Deformer deformer(sheet.mesh, sheet.roles, 1, options);
    for (const int passes : {4, 6, 16})
      for (const Affine& motion : {sheet.motion, turned}) {
        INFO(passes << " passes");
        CHECK(off_rigid(sheet.mesh.positions, surface(deformer, {motion}, usual(passes)), patch) <
              1e-3 * 0.4);
      }
  }
}

TEST_CASE("stiffness: steps keep a plate rigid, too") {
  const TaperedLimb limb(0.4, 0.4);
  const Eigen::VectorXf weights = weights_of(limb.mesh, in_plate);
  Deformer deformer(limb.mesh, limb.roles, 1, with_weights(weights));
  SplitMotion motion;
  motion.matrices.resize(12);
  Eigen::Map<Affine>(motion.matrices.data()) = kBent.motion;
  motion.steps = 3;
  const Positions p =
      limb.mesh.positions + split_update(deformer, motion, solid(0, kBent.turn)).offsets;
  CHECK(off_rigid(limb.mesh.positions, p, where(weights, 1)) < 0.01 * kPlateLength);
}

TEST_CASE("stiffness: a rigid plate acts like a handle that moves as the plate does") {
  const TaperedLimb limb(0.4, 0.4);
  const Eigen::VectorXf weights = weights_of(limb.mesh, in_plate);
  const std::vector<int> plate = where(weights, 1);
  std::vector<int> roles = limb.roles;
  for (int v : plate) roles[size_t(v)] = 1;
  Deformer stiff(limb.mesh, limb.roles, 1, with_weights(weights)), held(limb.mesh, roles, 2, {});
  UpdateOptions options = usual(200);
  options.of_method.refined.rim_smoothing = 0;
  for (const Pose& pose : {kBent, kTwisted}) {
    const Positions p = surface(stiff, {pose.motion}, options);
    const Affine motion = rigid_fit(limb.mesh.positions, p, plate);
    CHECK(largest_difference(surface(held, {pose.motion, motion}, options), p) < 0.01);
  }
}

TEST_CASE("stiffness: only its ratios matter, and without any nothing changes") {
  const TaperedLimb limb(0.5, 0.06);
  Deformer soft(limb.mesh, limb.roles, 1, {});
  const Positions expected = surface(soft, {kBent.motion}, solid(1, kBent.turn));
  for (const float weight : {0.0f, 0.3f, 1.0f}) {
    Deformer even(limb.mesh, limb.roles, 1,
                  with_weights(Eigen::VectorXf::Constant(limb.mesh.vertex_count(), weight)));
    const Positions p = surface(even, {kBent.motion}, solid(1, kBent.turn));
    CHECK(largest_difference(p, expected) == 0);
  }
}

TEST_CASE("stiffness: rest, rigid motions and scale stay as they are, whatever was painted") {
  const TaperedLimb limb(0.5, 0.06);
  std::mt19937 random(2);
  const Eigen::VectorXf noise = weights_of(
      limb.mesh, [&](const auto&) { return std::uniform_real_distribution<float>()(random); });
  const double box = bounding_box_diagonal(limb.mesh.positions);
  Deformer by_one(limb.mesh, held_by_one(limb.roles), 1, with_weights(noise));
  CHECK(largest_difference(surface(by_one, {identity()}, solid()), limb.mesh.positions) <
        1e-12 * box);
  const Affine motion = rotation_about(2.0, {1, 2, 3}, {0.1, 0, 0}, {3, 1, -2});
  CHECK(largest_difference(surface(by_one, {motion}, solid()),
                           transformed(motion, limb.mesh.positions)) < 1e-8 * box);

  Mesh large = limb.mesh;
  large.positions *= 1e3;
  Affine far = kLed.motion;
  far.col(3) *= 1e3;
  Deformer of_limb(limb.mesh, limb.roles, 1, with_weights(noise)),
      of_large(large, limb.roles, 1, with_weights(noise));
  CHECK(largest_difference(surface(of_large, {far}, solid()) / 1e3,
                           surface(of_limb, {kLed.motion}, solid())) < 1e-6 * box);
}

TEST_CASE("stiffness: more of it bends less, and the bend goes where there is less") {
  const TaperedLimb limb(0.4, 0.4);
  const std::vector<int> plate = where(weights_of(limb.mesh, in_plate), 1);
  double last = 1;
  for (const double weight : {0.0, 0.2, 0.4, 0.6, 0.8, 1.0}) {
    Deformer deformer(
        limb.mesh, limb.roles, 1,
        with_weights(weights_of(limb.mesh, [&](const auto& x) { return weight * in_plate(x); })));
    const double now = off_rigid(limb.mesh.positions,
                                 surface(deformer, {kBent.motion}, solid(1, kBent.turn)), plate);
    CHECK(now < 0.7 * last);
    last = now;
  }

  const auto joint = [](const Eigen::RowVector3d& x) {
    return std::abs(x[2] - 0.5 * TaperedLimb::kLength) > 0.4 ? 0.5 : 0;
  };
  const Eigen::VectorXf weights = weights_of(limb.mesh, joint);
  Deformer deformer(limb.mesh, limb.roles, 1, with_weights(weights));
  const Positions p = surface(deformer, {TaperedLimb::bend(60)}, solid(1, {0, radians(60), 0}));
  std::vector<int> below, above;
  for (int v : where(weights, 0.5f))
    (limb.mesh.positions(v, 2) < 0.5 * TaperedLimb::kLength ? below : above).push_back(v);
  CHECK(off_rigid(limb.mesh.positions, p, below) < 0.02);
  CHECK(off_rigid(limb.mesh.positions, p, above) < 0.02);
}

TEST_CASE("stiffness: the same on several threads, and in a file's order of vertices or another") {
  const TaperedLimb limb(0.4, 0.4, 1, 2);
  const Eigen::VectorXf weights = weights_of(limb.mesh, in_plate);
  BindOptions options = with_weights(weights);
  options.threads = 1;
  Deformer one(limb.mesh, limb.roles, 1, options);
  options.threads = 3;
  Deformer three(limb.mesh, limb.roles, 1, options);
  const Positions p = surface(one, {kBent.motion}, solid(1, kBent.turn));
  CHECK(largest_difference(surface(three, {kBent.motion}, solid(1, kBent.turn)), p) == 0);

  const int n = limb.mesh.vertex_count();
  Mesh turned = limb.mesh;
  std::vector<int> roles(limb.roles.rbegin(), limb.roles.rend());
  turned.positions = limb.mesh.positions.colwise().reverse();
  turned.triangles.array() = n - 1 - limb.mesh.triangles.array();
  Deformer reversed(turned, roles, 1, with_weights(weights.reverse()));
  CHECK(largest_difference(
            surface(reversed, {kBent.motion}, solid(1, kBent.turn)).colwise().reverse(), p) < 0.02);
}

TEST_CASE("stiffness: examples are met exactly") {
  const ThreePoses poses;
  const Mesh& mesh = poses.limb.mesh;
  const auto in_half = [](const Eigen::RowVector3d& x) {
    return std::abs(x[2] - 0.9) < 0.2 && x[0] > 0 ? 0.6 : 0;
  };
  BindOptions options = with(poses.examples);
  options.stiffness = weights_of(mesh, in_half);
  Deformer deformer(mesh, poses.handles.roles, 3, options);
  const std::vector<Affine> rest(3, identity());
  for (size_t i = 0; i < 3; ++i) {
    std::vector<double> weights(3, 0);
    weights[i] = 1;
    CHECK(largest_difference(surface(deformer, rest, posed_by(weights)), poses.examples[i]) < 1e-8);
  }
}

TEST_CASE("stiffness: a plate is rigid with a free handle, a base outside, another metric") {
  const TaperedLimb limb(0.4, 0.4);
  const Eigen::VectorXf weights = weights_of(limb.mesh, in_plate);
  const std::vector<int> plate = where(weights, 1);
  UpdateOptions placed = solid();
  placed.free = {1};
  Deformer deformer(limb.mesh, limb.roles, 1, with_weights(weights));
  CHECK(off_rigid(limb.mesh.positions, surface(deformer, {kLed.motion}, placed), plate) <
        1e-3 * kPlateLength);

  const Case sheet = lifted_plane(61);
  BindOptions options = with_weights(weights_of(sheet.mesh, [](const Eigen::RowVector3d& x) {
    return std::abs(x[0] - 0.3) < 0.1 && std::abs(x[1] - 0.5) < 0.2;
  }));
  const std::vector<int> patch = where(options.stiffness, 1);
  const auto check = [&](const BindOptions& how, const Positions* base) {
    Deformer other(sheet.mesh, sheet.roles, 1, how);
    const Positions p = sheet.mesh.positions + other.update(sheet.motion.data(), usual(), base);
    CHECK(off_rigid(sheet.mesh.positions, p, patch) < 1e-3);
    double moved = 0;
    for (int v : patch) moved += (p.row(v) - sheet.mesh.positions.row(v)).squaredNorm();
    CHECK(std::sqrt(moved) > 0.1);
  };
  check(options, nullptr);
  options.base_metric = BaseMetric::base;
  check(options, nullptr);
  options.base_metric = BaseMetric::surface;
  options.metric_smoothing = 2;
  check(options, nullptr);
  options.base = sheet.mesh.positions;  // followed by a base that shears
  Positions sheared = sheet.mesh.positions;
  sheared.col(2) += 0.2 * sheared.col(0);
  check(options, &sheared);
}

TEST_CASE("stiffness: small plates are rigid on a dense mesh, up to their borders", "[large]") {
  const TaperedLimb limb(0.4, 0.4, 1, 8);
  std::map<std::pair<int, int>, std::vector<int>> plates;
  Eigen::VectorXf weights = Eigen::VectorXf::Zero(limb.mesh.vertex_count());
  for (int v = 0; v < limb.mesh.vertex_count(); ++v) {
    const Eigen::RowVector3d x = limb.mesh.positions.row(v);
    const double along = x[2] / 0.25, around = (std::atan2(x[1], x[0]) + kPi) / 0.6;
    const bool inside = along - std::floor(along) < 0.5 && around - std::floor(around) < 0.5;
    if (!inside || x[2] < 0.75 || x[2] > 3.25 || around > 10) continue;
    weights[v] = 1;
    plates[{int(along), int(around)}].push_back(v);
  }
  Deformer deformer(limb.mesh, limb.roles, 1, with_weights(weights));
  for (const Pose& pose : {kBent, kTwisted}) {
    const Positions p = surface(deformer, {pose.motion}, solid(1, pose.turn));
    double worst = 0;
    for (const auto& [place, plate] : plates)
      worst = std::max(worst, off_rigid(limb.mesh.positions, p, plate) / 0.125);
    CHECK(plates.size() > 50);
    CHECK(worst < 3e-3);
  }
}

TEST_CASE("stiffness: a plate is rigid in a draft and on a large mesh", "[large]") {
  const TaperedLimb limb(0.4, 0.4, 1, 8);
  const Eigen::VectorXf weights = weights_of(limb.mesh, in_plate);
  const std::vector<int> plate = where(weights, 1);
  CHECK(limb.mesh.triangle_count() > 200'000);
  const std::unique_ptr<Draft> draft = Draft::make(limb.mesh, limb.roles, 1, with_weights(weights));
  REQUIRE(draft);
  Deformer deformer(limb.mesh, limb.roles, 1, with_weights(weights));
  for (const Pose& pose : {kBent, kTwisted, kLed}) {
    CHECK(off_rigid(limb.mesh.positions, surface(deformer, {pose.motion}, solid(1, pose.turn)),
                    plate) < 1e-3 * kPlateLength);
    const Positions drafted =
        draft->rest() + draft->update(pose.motion.data(), solid(1, pose.turn));
    CHECK(off_rigid(limb.mesh.positions, drafted, plate) < 0.03 * kPlateLength);
  }
}
