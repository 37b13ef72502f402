// SPDX-License-Identifier: GPL-3.0-or-later
// Posing by example where the handles ask for a pose that no mix of the examples has.
#include "catch.h"
#include "limbs.h"

using namespace dd;
using test::Affine;
using test::box;
using test::Handled;
using test::Limb;
using test::surface;
using test::ThreePoses;
using test::triangle_at;
using test::with;

namespace {

UpdateOptions refined(MethodKind method, int iterations = 4) {
  UpdateOptions options = test::by(method, method != MethodKind::examples);
  options.of_method.refined.iterations = iterations;
  options.of_method.refined.rim_smoothing = 0.05;
  return options;
}

double mean_difference(const Positions& a, const Positions& b) {
  return (a - b).rowwise().norm().mean();
}

/// Each motion followed by `next`.
std::vector<Affine> then(const std::vector<Affine>& motions, const Affine& next) {
  std::vector<Affine> result;
  for (const Affine& motion : motions) {
    Affine both;
    both.leftCols<3>() = next.leftCols<3>() * motion.leftCols<3>();
    both.col(3) = next.leftCols<3>() * motion.col(3) + next.col(3);
    result.push_back(both);
  }
  return result;
}

/// The first example with its end bent sideways: a pose that no mix of the examples has.
struct Beyond {
  ThreePoses poses;
  Positions truth;
  std::vector<Affine> motions;
  Beyond() {
    const Positions bent = poses.examples[0];
    truth = bent;
    const Affine turn =
        test::rotation_about(test::radians(40), {1, 0, 0}, poses.limb.centre(bent, 17), {0, 0, 0});
    for (Index v = 0; v < truth.rows(); ++v) {
      const double share = std::clamp((poses.limb.mesh.positions(v, 2) - 0.8) / 0.1, 0.0, 1.0);
      truth.row(v) += share * (test::transformed(turn, bent.row(v)) - bent.row(v));
    }
    motions = poses.handles.at(poses.limb.mesh, truth);
  }
};

}  // namespace

TEST_CASE("EXAMPLES: the result turns with all handles, and doesn't turn with an example") {
  const Beyond of;
  const Mesh& mesh = of.poses.limb.mesh;
  std::vector<int> roles = of.poses.handles.roles;
  for (int& role : roles)
    if (role == kFixed) role = 3;  // held by one more handle, which turns too
  std::vector<Affine> motions = of.motions;
  motions.push_back(test::rotation_about(0.1, {1, 0, 0}, {0, 0, 0}, {0.02, 0, 0}));
  std::vector<Positions> turned_examples;
  for (size_t i = 0; i < of.poses.examples.size(); ++i)
    turned_examples.push_back(test::transformed(
        test::rotation_about(1 + 0.8 * double(i), {0.3, 1, -0.5}, {0, 0, 0}, {0.4, 0, 1}),
        of.poses.examples[i]));
  for (Precision precision : {Precision::full, Precision::single})
    for (int iterations : {0, 4}) {
      const double close = (precision == Precision::full ? 1e-7 : 1e-5) * box(mesh);
      const UpdateOptions options = refined(MethodKind::examples, iterations);
      Deformer deformer(mesh, roles, 4, with(of.poses.examples, precision));
      const Positions once = surface(deformer, motions, options);
      for (double degrees : {45.0, 90.0, 170.0}) {
        const Affine turn = test::rotation_about(test::radians(degrees), {0.2, -1, 0.6},
                                                 {0.3, 0.1, 0}, {0, 0.7, 0});
        CHECK(test::largest_difference(surface(deformer, then(motions, turn), options),
                                       test::transformed(turn, once)) < close);
      }
      Deformer other(mesh, roles, 4, with(turned_examples, precision));
      CHECK(test::largest_difference(surface(other, motions, options), once) < 10 * close);
    }
}

TEST_CASE("EXAMPLES by given weights: an example that is moved rigidly is met in its place") {
  const ThreePoses poses;
  std::vector<int> roles = poses.handles.roles;
  for (int& role : roles)
    if (role == kFixed) role = 3;
  const Affine turn = test::rotation_about(2, {0.3, 1, -0.5}, {0, 0, 0}, {0.4, 0, 1});
  const std::vector<Positions> examples = {test::transformed(turn, poses.examples[0]),
                                           poses.examples[2]};
  Deformer deformer(poses.limb.mesh, roles, 4, with(examples));
  const std::vector<Affine> still(4, test::rotation_about(0, {0, 0, 1}, {0, 0, 0}, {0, 0, 0}));
  CHECK(test::largest_difference(surface(deformer, still, test::posed_by({1, 0})), examples[0]) <
        1e-9);
  CHECK(test::largest_difference(surface(deformer, still, test::posed_by({0, 1})), examples[1]) <
        1e-9);
}

TEST_CASE("EXAMPLES, refined: handles at an example's places reproduce it, on dense limbs too") {
  for (int density : {1, 3}) {
    const Limb limb(32 * density + 1, 12 * density);
    const std::vector<Positions> examples = {limb.bent(80, 0.5), limb.bent(60, 1.1, 200)};
    const Handled handles(limb, {triangle_at(limb, 22 * density, 7 * density),
                                 triangle_at(limb, 30 * density, 4 * density)});
    for (Precision precision : {Precision::full, Precision::single}) {
      Deformer deformer(limb.mesh, handles.roles, 2, with(examples, precision));
      for (size_t i = 0; i < examples.size(); ++i) {
        const Positions result =
            surface(deformer, handles.at(limb.mesh, examples[i]), refined(MethodKind::examples));
        CHECK(test::largest_difference(result, examples[i]) < 5e-4 * box(limb.mesh));
        CHECK(deformer.findings(MethodKind::examples).example_weights[i] == Approx(1).margin(5e-3));
      }
      CHECK(test::largest_difference(surface(deformer, handles.at(limb.mesh, limb.mesh.positions),
                                             refined(MethodKind::examples)),
                                     limb.mesh.positions) < 1e-6);
    }
  }
}

TEST_CASE("EXAMPLES, refined: beyond them the surface turns as by detail transfer") {
  const Beyond of;
  const Limb& limb = of.poses.limb;
  // Handles near the end alone, so that the examples say where the limb bends.
  const Handled handles(limb, {triangle_at(limb, 28, 2), triangle_at(limb, 31, 7)});
  const std::vector<Affine> motions = handles.at(limb.mesh, of.truth);
  Deformer deformer(limb.mesh, handles.roles, 2, with(of.poses.examples));
  const auto error = [&](const UpdateOptions& options) {
    return mean_difference(surface(deformer, motions, options), of.truth) / box(limb.mesh);
  };
  const double by_examples = error(refined(MethodKind::examples));
  CHECK(by_examples < 0.8 * error(refined(MethodKind::examples, 0)));
  CHECK(by_examples < 0.8 * error(refined(MethodKind::detail)));
  // The handles are met.
  const Positions result = surface(deformer, motions, refined(MethodKind::examples));
  for (size_t h = 0; h < motions.size(); ++h)
    for (int k = 0; k < 3; ++k) {
      const int v = limb.mesh.triangles(handles.triangles[h], k);
      CHECK((result.row(v) - test::transformed(motions[h], limb.mesh.positions.row(v))).norm() <
            1e-9);
    }
}

TEST_CASE("EXAMPLES, refined: without examples it is detail transfer") {
  const Beyond of;
  const Mesh& mesh = of.poses.limb.mesh;
  Deformer deformer(mesh, of.poses.handles.roles, 3, with({}));
  std::vector<Affine> motions;
  for (double angle : {0.2, 0.4, 0.6})
    motions.push_back(test::rotation_about(angle, {1, 0, 0}, {0, 0, 0.4}, {0, 0.1 * angle, 0}));
  UpdateOptions transfer = refined(MethodKind::detail, 12);
  transfer.base_deformer = BaseDeformer::linear;
  const Positions there = surface(deformer, motions, transfer);
  const Positions here = surface(deformer, motions, refined(MethodKind::examples, 12));
  CHECK(mean_difference(there, mesh.positions) > 0.02 * box(mesh));
  CHECK(mean_difference(here, there) < 1e-3 * box(mesh));
}

TEST_CASE("EXAMPLES, refined: a handle that only places has its vertices' mean in its place") {
  const Beyond of;
  const Mesh& mesh = of.poses.limb.mesh;
  Deformer deformer(mesh, of.poses.handles.roles, 3, with(of.poses.examples));
  UpdateOptions options = refined(MethodKind::examples);
  options.free = {0, 0, 1};
  const Positions result = surface(deformer, of.motions, options);
  Eigen::RowVector3d mean = Eigen::RowVector3d::Zero(), told = mean;
  for (int k = 0; k < 3; ++k) {
    const int v = mesh.triangles(of.poses.handles.triangles[2], k);
    mean += result.row(v) / 3;
    told += test::transformed(of.motions[2], mesh.positions.row(v)) / 3;
  }
  CHECK((mean - told).norm() < 1e-9);
}

TEST_CASE("EXAMPLES, refined: a dense limb reaches an example by a free handle") {
  const Limb limb(97, 36);
  const Positions bent = limb.bent(80, 0.5);
  std::vector<int> roles(static_cast<size_t>(limb.mesh.vertex_count()), kFree);
  Eigen::RowVector3d from = Eigen::RowVector3d::Zero(), to = from;
  double count = 0;
  for (int v = 0; v < limb.mesh.vertex_count(); ++v) {
    const double z = limb.mesh.positions(v, 2);
    roles[v] = z < 0.1 ? kFixed : z > 1.4 ? 0 : kFree;
    if (roles[v] != 0) continue;
    from += limb.mesh.positions.row(v);
    to += bent.row(v);
    ++count;
  }
  const std::vector<Affine> motion = {
      test::rotation_about(0, {0, 0, 1}, {0, 0, 0}, ((to - from) / count).transpose())};
  Deformer deformer(limb.mesh, roles, 1, with({bent}));
  UpdateOptions options = refined(MethodKind::examples);
  options.free = {1};
  CHECK(test::largest_difference(surface(deformer, motion, options), bent) < 5e-3 * box(limb.mesh));
  CHECK(deformer.findings(MethodKind::examples).example_weights[0] == Approx(1).margin(0.02));
}

TEST_CASE("EXAMPLES, refined: the number of threads changes nothing", "[threads]") {
  const Limb limb(97, 36);
  const Handled handles(limb, {triangle_at(limb, 66, 7), triangle_at(limb, 90, 20)});
  Positions first;
  for (int threads : {1, 2, 5}) {
    BindOptions how = with({limb.bent(80, 0.5), limb.bent(60, 1.1, 200)}, Precision::single);
    how.threads = threads;
    Deformer deformer(limb.mesh, handles.roles, 2, how);
    const Positions result = surface(deformer, handles.at(limb.mesh, limb.bent(50, 0.6, 40)),
                                     refined(MethodKind::examples));
    if (first.size() == 0)
      first = result;
    else
      CHECK(result == first);
  }
}
