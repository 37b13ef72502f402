// SPDX-License-Identifier: GPL-3.0-or-later
// Results of scenes that use every method, transfer and match, for constants.py, which builds this
// with constants that can be varied from outside.
//
//   constants FILE [BEGINNING...]     the scenes whose names begin so; all of them
//
// Prints a line a scene: its name, its measure (the stretch of a deformation; the error of a match
// or a transfer with a known truth, as a fraction of the box) and its processor time in ms. FILE
// gets the positions of each scene as doubles, as fractions of its box, after their number.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "cases.h"
#include "creatures.h"
#include "deform/draft.h"
#include "deform/mesh_transfer.h"
#include "deform/split_motion.h"
#include "faces.h"
#include "match/points_of_fit.h"
#include "match/registration.h"
#include "match/triangle_match.h"
#include "mesh/measures.h"
#include "mesh/unit_box.h"
#include "triangulations.h"
#include "wear/nearest_points.h"

namespace {

using dd::Index;
using dd::Mesh;
using dd::Positions;
using dd::test::Affine;
using dd::test::ball;
using dd::test::Case;
using dd::test::face;
using dd::test::Lids;

struct Outcome {
  Positions positions;
  double measure;
};

struct Scene {
  std::string name;
  std::function<Outcome()> run;
};

Positions in_unit_box(const Positions& p, const Positions& rest) {
  return p / dd::bounding_box_diagonal(rest);
}

Outcome deformed(const Mesh& mesh, const Positions& p) {
  return {in_unit_box(p, mesh.positions), dd::mean_stretch(mesh, p)};
}

dd::UpdateOptions usual(dd::MethodKind method = dd::MethodKind::detail, int iterations = 4) {
  dd::UpdateOptions options;
  options.method = method;
  options.of_method.refined.iterations = iterations;
  options.of_method.refined.rim_smoothing = 0.05;
  return options;
}

int handle_count(const std::vector<int>& roles) {
  return std::max(0, 1 + *std::max_element(roles.begin(), roles.end()));
}

std::vector<double> numbers(const std::vector<Affine>& matrices) {
  std::vector<double> result;
  for (const Affine& matrix : matrices)
    result.insert(result.end(), matrix.data(), matrix.data() + 12);
  return result;
}

/// One case by some options; more matrices are of more handles.
Outcome pulled(const Case& one, dd::UpdateOptions update, const dd::BindOptions& bind = {},
               std::vector<Affine> motions = {}, const Positions* base = nullptr) {
  const int handles = handle_count(one.roles);
  if (handles > 0) motions.insert(motions.begin(), one.motion);
  dd::Deformer deformer(one.mesh, one.roles, handles, bind);
  const std::vector<double> matrices = numbers(motions);
  if (!update.turns.empty()) update.base_deformer = dd::BaseDeformer::motions;
  return deformed(one.mesh, one.mesh.positions + deformer.update(matrices.data(), update, base));
}

dd::UpdateOptions turned(double degrees, const Eigen::Vector3d& axis) {
  dd::UpdateOptions options = usual();
  const Eigen::Vector3d turn = dd::test::radians(degrees) * axis;
  options.turns.assign(turn.data(), turn.data() + 3);
  return options;
}

/// The upper part of a case becomes free: only its place is given.
Outcome led(Case one) {
  dd::UpdateOptions options = usual();
  options.free = {1};
  one.motion = dd::test::identity();
  one.motion.col(3) << 0.5, 0.1, -0.4;
  return pulled(one, options);
}

/// A handle at the middle besides the end's.
Case with_two_handles(Case one) {
  const double top = one.mesh.positions.col(2).maxCoeff();
  for (Index v = 0; v < one.mesh.positions.rows(); ++v)
    if (std::abs(one.mesh.positions(v, 2) - 0.5 * top) < 0.03 * top) one.roles[size_t(v)] = 1;
  return one;
}

/// A long strip of few columns, held at one end: its systems are the worst conditioned.
Case strip(int rows) {
  Case made;
  made.mesh =
      dd::test::grid(rows, 8, [](double x, double y) { return 0.01 * std::sin(60 * x) * y; });
  made.mesh.positions.col(1) *= 8.0 / rows;
  made.roles = dd::test::strip_roles(rows, 8, 2, rows - 2);
  made.motion = dd::test::rotation_about(0.5, {0, 1, 0}, {1, 0, 0}, {-0.1, 0, 0.1});
  return made;
}

Case with_thin_triangles() {
  Case made = dd::test::lifted_plane(61);
  made.mesh = dd::test::with_slivers(made.mesh, 0.5);
  return made;
}

/// A base from outside with fewer triangles, a tube in a cylinder, bent.
Outcome over_a_cage() {
  const Case one = dd::test::bent_cylinder();
  const auto cage = [](double bend) {
    Mesh mesh = dd::test::tube(17, 8, [](double u, double v) {
      return Eigen::RowVector3d(0.1 * std::cos(v), 0.1 * std::sin(v), 1.7 * u - 0.85);
    });
    if (bend != 0) mesh.positions = dd::test::bent_explicitly(mesh.positions, bend, 0.3);
    mesh.positions.col(2).array() += 0.8;
    return mesh;
  };
  dd::BindOptions bind;
  bind.base = cage(0).positions;
  bind.base_triangles = cage(0).triangles;
  const Positions base = cage(100).positions;
  Case free = one;
  std::fill(free.roles.begin(), free.roles.end(), dd::kFree);
  return pulled(free, usual(), bind, {}, &base);
}

Outcome by_examples() {
  const Case one = dd::test::bent_cylinder();
  dd::BindOptions bind;
  for (double degrees : {40.0, 80.0}) {
    Positions centred = one.mesh.positions;
    centred.col(2).array() -= 0.8;
    bind.examples.push_back(dd::test::bent_explicitly(centred, degrees, 0.4));
  }
  return pulled(one, usual(dd::MethodKind::examples), bind);
}

Outcome drafted() {
  const Case one = dd::test::subdivided(dd::test::subdivided(dd::test::twisted_bar()));
  const auto draft = dd::Draft::make(one.mesh, one.roles, 1, {});
  if (!draft) return {Positions(0, 3), std::nan("")};
  return deformed(one.mesh,
                  one.mesh.positions + draft->update(numbers({one.motion}).data(), usual()));
}

Outcome by_steps() {
  const Case one = dd::test::twisted_bar(300);
  dd::Deformer deformer(one.mesh, one.roles, 1, {});
  const dd::SplitMotion motion{numbers({one.motion}), 3};
  const dd::SplitResult result = dd::split_update(deformer, motion, turned(300, {0, 0, 1}));
  return deformed(one.mesh, one.mesh.positions + result.offsets);
}

// Transfer and match

struct Pose {
  Mesh source, target;
  Positions posed_source, posed_target;  // posed_target: what is right, or without rows
  dd::Pairs markers = {};
};

/// The vertices of a finer sphere's topology that a coarser one has come first, at any level.
Pose beasts(int source_levels, int target_levels) {
  Pose made;
  made.source = dd::test::beast(source_levels);
  made.target = dd::test::beast(target_levels);
  made.posed_source = dd::test::raised(made.source.positions, 0.6);
  made.posed_target = dd::test::raised(made.target.positions, 0.6);
  return made;
}

double error(const Positions& p, const Positions& truth) {
  return truth.rows() == p.rows() ? dd::test::mean_error(p, truth) : 0;
}

/// source registered onto target; truth: where its vertices belong.
Outcome matched(const Mesh& source, const Mesh& target, const Positions& truth,
                const dd::Pairs& markers = {}) {
  const Positions fitted = dd::register_onto(source, target, markers, {});
  return {in_unit_box(fitted, target.positions), error(fitted, truth)};
}

Outcome matched_to_pose(const Mesh& source, const Mesh& finer,
                        const std::function<Positions(const Positions&)>& pose,
                        const dd::Pairs& markers = {}) {
  return matched(source, {dd::test::turned(pose(finer.positions), 0.3), finer.triangles},
                 dd::test::turned(pose(source.positions), 0.3), markers);
}

Outcome transferred(const Pose& pose, dd::TransferOptions options, bool rotation_only = false) {
  const Positions fitted = dd::register_onto(pose.source, pose.target, pose.markers, {});
  const Mesh registered{fitted, pose.source.triangles};
  const dd::Match match = dd::match_triangles(registered, pose.target, 0.1);
  dd::ThreadPool pool(2);
  options.points = dd::points_of_fit(registered, pose.target, match.correspondence, pool);
  dd::MeshTransfer transfer(pose.source, pose.target, match.correspondence, options);
  const Positions result = transfer.apply(pose.posed_source, rotation_only);
  return {in_unit_box(result, pose.target.positions), error(result, pose.posed_target)};
}

dd::TransferOptions by(dd::Placing placing) {
  dd::TransferOptions options;
  options.placing = placing;
  return options;
}

/// A head with two eyes and a mouth's gap: two lips that meet in the pose.
Mesh head(int levels, double size, double eye) {
  Mesh mesh = ball(levels, {0, 0, 0}, size);
  for (Index v = 0; v < mesh.positions.rows(); ++v) {
    auto p = mesh.positions.row(v);
    const double front = std::exp(-8 * (p / size - Eigen::RowVector3d(1, 0, -0.3)).squaredNorm());
    p.x() -= 0.5 * size * front * std::exp(-std::pow((p.z() / size + 0.3) / 0.08, 2));
  }
  for (int side : {-1, 1})
    mesh = dd::test::appended(
        mesh, ball(levels - 1, size * Eigen::RowVector3d(0.8, 0.45 * side, 0.4).normalized(), eye));
  return mesh;
}

Positions lips_closed(const Positions& p, double size) {
  Positions result = p;
  for (Index v = 0; v < p.rows(); ++v) {
    const double front =
        std::exp(-8 * (p.row(v) / size - Eigen::RowVector3d(1, 0, -0.3)).squaredNorm());
    const double above = p(v, 2) / size + 0.3;
    result(v, 2) -= 0.6 * size * front * above * std::exp(-std::pow(above / 0.15, 2));
  }
  return result;
}

Pose heads() {
  Pose made;
  made.source = head(5, 1, 0.25);
  made.target = head(4, 1.1, 0.24);
  made.posed_source = lips_closed(made.source.positions, 1);
  made.posed_target = lips_closed(made.target.positions, 1.1);
  return made;
}

Outcome closed_lids() {
  const Lids source(0.1), target(0.16);
  dd::MeshTransfer transfer(source.mesh, target.mesh,
                            dd::identity_correspondence(source.mesh, target.mesh),
                            by(dd::Placing::vertices));
  const Positions& result = transfer.apply(Lids::closed(source.mesh.positions, 0.1), false);
  return {in_unit_box(result, target.mesh.positions),
          error(result, Lids::closed(target.mesh.positions, 0.16))};
}

Mesh cylinder(int rings, int sides, double radius, double low, double high) {
  return dd::test::tube(rings, sides, [=](double u, double v) {
    return Eigen::RowVector3d(radius * std::cos(v), radius * std::sin(v), low + (high - low) * u);
  });
}

/// A limb that linear blend skinning folds, in a garment of two layers.
Outcome worn(double degrees, double gap) {
  const Mesh body = cylinder(61, 40, 0.3, -1, 1);
  const Mesh garment =
      dd::test::appended(cylinder(41, 48, 0.32, -0.6, 0.6), cylinder(31, 40, 0.335, -0.4, 0.5));
  Positions pose = body.positions;
  const Affine turn =
      dd::test::rotation_about(dd::test::radians(degrees), {0, 1, 0}, {0, 0, 0}, {0, 0, 0});
  const Positions turned = dd::test::transformed(turn, pose);
  for (Index v = 0; v < pose.rows(); ++v)
    pose.row(v) += (turned.row(v) - pose.row(v)) / (1 + std::exp(-pose(v, 2) / 0.15));
  dd::ThreadPool pool(2);
  const dd::NearestPoints points(body, garment, {}, pool);
  dd::TransferOptions options = by(dd::Placing::vertices);
  options.worn = &points;
  options.gap = gap;
  dd::MeshTransfer transfer(body, garment, points.correspondence(body, garment), options);
  return deformed(garment, transfer.apply(pose, false));
}

std::vector<Scene> scenes() {
  using dd::test::beast;
  std::vector<Scene> all;
  const auto add = [&](std::string name, std::function<Outcome()> run) {
    all.push_back({std::move(name), std::move(run)});
  };
  for (const Case& one : dd::test::survey_cases())
    add("deform: " + one.name, [one] { return pulled(one, usual()); });
  add("deform: bar, 16 iterations", [] {
    return pulled(dd::test::subdivided(dd::test::twisted_bar()), usual(dd::MethodKind::detail, 16));
  });
  add("deform: cylinder bent 170",
      [] { return pulled(dd::test::bent_cylinder(170), turned(170, {0, 1, 0})); });
  for (double degrees : {200.0, 400.0, 700.0})
    add("deform: bar twisted " + std::to_string(int(degrees)),
        [degrees] { return pulled(dd::test::twisted_bar(degrees), turned(degrees, {0, 0, 1})); });
  add("deform: bar in steps", by_steps);
  add("deform: draft", drafted);
  add("deform: cylinder led, free", [] { return led(dd::test::bent_cylinder()); });
  add("deform: two free handles far apart", [] {
    dd::UpdateOptions options = turned(160, {0, 1, 0});
    options.turns.resize(6, 0.0);
    options.free = {0, 1};
    return pulled(with_two_handles(dd::test::bent_cylinder(160)), options, {},
                  {dd::test::identity()});
  });
  add("deform: strip, 2000 rows", [] { return pulled(strip(2000), usual()); });
  add("deform: plane in single precision", [] {
    dd::BindOptions bind;
    bind.precision = dd::Precision::single;
    return pulled(dd::test::lifted_plane(201), usual(), bind);
  });
  add("deform: thin triangles", [] { return pulled(with_thin_triangles(), usual()); });
  add("deform: metric of the base", [] {
    dd::BindOptions bind;
    bind.base_metric = dd::BaseMetric::base;
    return pulled(dd::test::bent_cactus(), usual(), bind);
  });
  add("deform: proxy", over_a_cage);
  for (const auto& [name, method] : {std::pair{"normal displacement", dd::MethodKind::normal},
                                     {"gradient editing", dd::MethodKind::gradient},
                                     {"displacement volumes", dd::MethodKind::volumes}})
    add(std::string("deform: ") + name,
        [method = method] { return pulled(dd::test::bent_cactus(), usual(method)); });
  add("deform: examples", by_examples);

  add("match: pose", [] {
    return matched_to_pose(beast(4), beast(5),
                           [](const Positions& p) { return dd::test::raised(p, 0.8); });
  });
  add("match: legs in stride", [] {
    return matched_to_pose(dd::test::quadruped(4), dd::test::quadruped(5),
                           [](const Positions& p) { return dd::test::striding(p, 0.6); });
  });
  add("match: longer legs", [] {
    Mesh target = dd::test::quadruped(5, 3, 1.2);
    return matched(dd::test::quadruped(4), target, dd::test::quadruped(4, 3, 1.2).positions);
  });
  add("match: legs aside",
      [] { return matched_to_pose(dd::test::forked(4), dd::test::forked(5), dd::test::aside); });
  add("match: a cavity on one", [] { return matched(dd::test::hollow(5), beast(4), {}); });
  add("match: a cut part", [] {
    const Mesh whole = beast(5);
    Mesh part = whole;
    std::vector<int> kept;
    for (Index j = 0; j < whole.triangles.rows(); ++j)
      if (whole.positions(whole.triangles(j, 0), 0) > 0)
        for (int k = 0; k < 3; ++k) kept.push_back(whole.triangles(j, k));
    part.triangles = Eigen::Map<dd::Triangles>(kept.data(), Index(kept.size() / 3), 3);
    std::vector<int> number(size_t(whole.positions.rows()), -1);
    std::vector<Eigen::RowVector3d> used;
    for (int& corner : part.triangles.reshaped()) {
      if (number[size_t(corner)] < 0) {
        number[size_t(corner)] = int(used.size());
        used.push_back(whole.positions.row(corner));
      }
      corner = number[size_t(corner)];
    }
    part.positions.resize(Index(used.size()), 3);
    for (size_t i = 0; i < used.size(); ++i) part.positions.row(Index(i)) = used[i];
    return matched(part, {dd::test::turned(beast(4).positions, 0.2), beast(4).triangles},
                   dd::test::turned(part.positions, 0.2));
  });
  add("match: six markers", [] {
    dd::Pairs markers;
    const Mesh source = dd::test::quadruped(4), target = dd::test::quadruped(4, 3, 0.8);
    for (int k = 0; k < 6; ++k) {
      Index at = 0;
      const Eigen::RowVector3d way(dd::test::kLimbs[k][0], dd::test::kLimbs[k][1],
                                   dd::test::kLimbs[k][2]);
      (source.positions * way.transpose()).maxCoeff(&at);
      markers.push_back({int(at), int(at)});
    }
    return matched(source, {dd::test::turned(target.positions, 1), target.triangles},
                   dd::test::turned(target.positions, 1), markers);
  });
  add("match: head and eyes", [] { return matched(heads().source, heads().target, {}); });
  add("match: eyes that stand out",
      [] { return matched(face(4, 0.3, 0.7), face(4, 0.26, 0.7, 0.99), {}); });
  add("match: another animal", [] {
    return matched(dd::test::quadruped(4, 1.2, 2.2), dd::test::quadruped(5, 3.5, 0.6),
                   dd::test::quadruped(4, 3.5, 0.6).positions);
  });
  add("transfer: a slit closes", closed_lids);
  add("transfer: by places", [] { return transferred(beasts(5, 4), by(dd::Placing::vertices)); });
  add("transfer: by parts", [] { return transferred(heads(), by(dd::Placing::parts)); });
  add("transfer: displacements",
      [] { return transferred(heads(), by(dd::Placing::displacements)); });
  add("transfer: rotations",
      [] { return transferred(beasts(4, 5), by(dd::Placing::components), true); });
  add("transfer: lips close", [] { return transferred(heads(), by(dd::Placing::vertices)); });
  add("garment, bent 40", [] { return worn(40, -1); });
  add("garment, bent 75, kept outside", [] { return worn(75, 0.002); });
  return all;
}

void write(std::FILE* file, const Positions& p) {
  const auto count = std::uint64_t(p.size());
  std::fwrite(&count, sizeof count, 1, file);
  std::fwrite(p.data(), sizeof(double), size_t(count), file);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) return std::fprintf(stderr, "constants FILE [BEGINNING...]\n"), 2;
  const std::vector<std::string> wanted(argv + 2, argv + argc);
  std::FILE* file = std::fopen(argv[1], "wb");
  if (!file) return std::perror(argv[1]), 1;
  for (const Scene& scene : scenes()) {
    const auto begins = [&](const std::string& text) { return scene.name.rfind(text, 0) == 0; };
    if (!wanted.empty() && std::none_of(wanted.begin(), wanted.end(), begins)) continue;
    Outcome outcome;
    const std::clock_t start = std::clock();
    try {
      outcome = scene.run();
    } catch (const dd::Error& error) {
      outcome = {Positions(0, 3), std::nan("")};
      std::fprintf(stderr, "%s: %s\n", scene.name.c_str(), error.what());
    }
    const double ms = 1e3 * double(std::clock() - start) / CLOCKS_PER_SEC;
    std::printf("%s\t%.6g\t%.1f\n", scene.name.c_str(), outcome.measure, ms);
    write(file, outcome.positions);
  }
  return std::fclose(file) ? 1 : 0;
}
