// SPDX-License-Identifier: GPL-3.0-or-later
#include <Eigen/Dense>

#include "catch.h"
#include "limbs.h"

using namespace dd;
using test::Affine;
using test::box;
using test::Handled;
using test::Limb;
using test::posed;
using test::surface;
using test::ThreePoses;
using test::triangle_at;
using test::with;

namespace {

Eigen::Matrix3d logarithm(const Eigen::Matrix3d& R) {
  const double angle = std::acos(std::min(1.0, (R.trace() - 1) / 2));
  return angle < 1e-7 ? Eigen::Matrix3d(0.5 * (R - R.transpose()))
                      : Eigen::Matrix3d(angle / (2 * std::sin(angle)) * (R - R.transpose()));
}

/// By the power series: another way than the core's.
Eigen::Matrix3d exponential(const Eigen::Matrix3d& A) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Identity(), term = sum;
  for (int k = 1; k < 40; ++k) sum += term = (term * A / k).eval();
  return sum;
}

/// Energy and positions for given weights, by dense matrices.
struct DensePose {
  double energy;
  Positions positions;
};

DensePose dense_pose(const Mesh& mesh, const test::DenseOperators& op,
                     const std::vector<int>& roles, const std::vector<Positions>& examples,
                     const Positions& held, const Eigen::VectorXd& weights) {
  const int m = mesh.triangle_count();
  const Eigen::MatrixXd G = op.G * mesh.positions;
  Eigen::MatrixXd wanted(3 * m, 3);
  for (int j = 0; j < m; ++j) {
    Eigen::Matrix3d turn = Eigen::Matrix3d::Zero(), stretch = Eigen::Matrix3d::Identity();
    for (size_t i = 0; i < examples.size(); ++i) {
      const Eigen::Matrix3d S =
          test::deformation_gradient(mesh.positions, examples[i], mesh.triangles, j);
      const Eigen::Matrix3d R = test::polar_rotation(S);
      turn += weights[Index(i)] * logarithm(R);
      stretch += weights[Index(i)] * (R.transpose() * S - Eigen::Matrix3d::Identity());
    }
    wanted.middleRows<3>(3 * j) =
        G.middleRows<3>(3 * j) * (exponential(turn) * stretch).transpose();
  }
  DensePose pose;
  pose.positions = test::dense_solve(op.L, held, roles, op.G.transpose() * op.D * wanted);
  Eigen::MatrixXd misfit = op.G * pose.positions - wanted;
  for (int j = 0; j < m; ++j) {
    bool follows = false;
    for (int k = 0; k < 3; ++k) follows |= roles[mesh.triangles(j, k)] == kFree;
    if (!follows) misfit.middleRows<3>(3 * j).setZero();
  }
  pose.energy = (op.D * misfit).cwiseProduct(misfit).sum();
  return pose;
}

}  // namespace

TEST_CASE("EXAMPLES: handles at an example's places reproduce it, in either precision") {
  const ThreePoses poses;
  const Mesh& mesh = poses.limb.mesh;
  for (Precision precision : {Precision::full, Precision::single}) {
    Deformer deformer(mesh, poses.handles.roles, 3, with(poses.examples, precision));
    for (size_t i = 0; i < 3; ++i) {
      const Positions result =
          surface(deformer, poses.handles.at(mesh, poses.examples[i]), posed());
      CHECK(test::largest_difference(result, poses.examples[i]) < 1e-4 * box(mesh));
      for (size_t k = 0; k < 3; ++k)
        CHECK(deformer.findings(MethodKind::examples).example_weights[k] ==
              Approx(k == i ? 1 : 0).margin(1e-3));
    }
    CHECK(test::largest_difference(
              surface(deformer, poses.handles.at(mesh, mesh.positions), posed()), mesh.positions) <
          1e-12);
    for (double weight : deformer.findings(MethodKind::examples).example_weights)
      CHECK(std::abs(weight) < 1e-9);
  }
}

TEST_CASE("EXAMPLES: half-way along a bend of 120 degrees a limb keeps its length") {
  const Limb limb(65, 16);
  const Positions bent = limb.bent(120, 0.5), half = limb.bent(60, 0.5);
  Handled handles(limb, {triangle_at(limb, 62, 3), triangle_at(limb, 62, 11)});
  Deformer deformer(limb.mesh, handles.roles, 2, with({bent}));
  const Positions result = surface(deformer, handles.at(limb.mesh, half), posed());
  const auto length = [&](const Positions& p) {
    return (limb.centre(p, 60) - limb.centre(p, 32))
        .norm();  // of the straight part beyond the joint
  };
  CHECK(length(result) == Approx(length(limb.mesh.positions)).epsilon(0.01));
  CHECK(deformer.findings(MethodKind::examples).example_weights[0] == Approx(0.5).margin(0.02));
  CHECK(test::largest_difference(result, half) < 0.01 * box(limb.mesh));
  // Linear blending of positions halves this length.
  const Positions blended = 0.5 * (limb.mesh.positions + bent);
  CHECK(length(blended) == Approx(0.5 * length(limb.mesh.positions)).epsilon(0.01));
}

TEST_CASE("EXAMPLES: a half turn is found, though the energy has no slope towards it at rest") {
  const Limb limb;
  const Positions bent = limb.bent(180, 0.5);
  Handled handles(limb, {triangle_at(limb, 30, 3), triangle_at(limb, 30, 9)});
  Deformer deformer(limb.mesh, handles.roles, 2, with({bent}));
  CHECK(test::largest_difference(surface(deformer, handles.at(limb.mesh, bent), posed()), bent) <
        1e-4 * box(limb.mesh));
}

TEST_CASE(
    "EXAMPLES without examples, or with rest as the only one, is Poisson with S's gradients") {
  const Mesh mesh = test::rough_sphere(2, 0.15);
  const std::vector<int> roles = test::roles_by_height(mesh, -0.5, 0.7);
  const std::vector<Affine> motion = {
      test::rotation_about(0.6, {1, 0.3, 0}, {0, 0, 1}, {0.2, 0.1, 0.4})};
  const auto op = test::dense_operators(mesh.positions, mesh.triangles);
  Positions held = mesh.positions;
  for (int v = 0; v < mesh.vertex_count(); ++v)
    if (roles[v] == 0) held.row(v) = test::transformed(motion[0], held.row(v));
  const Positions expected = test::dense_solve(op.L, held, roles, op.L * mesh.positions);
  const std::vector<std::vector<Positions>> sets = {{}, {mesh.positions}};
  for (const auto& examples : sets) {
    Deformer deformer(mesh, roles, 1, with(examples));
    CHECK(test::largest_difference(surface(deformer, motion, posed()), expected) < 1e-9);
    CHECK(deformer.findings(MethodKind::examples).example_weights.size() == examples.size());
  }
}

TEST_CASE("EXAMPLES: the result is the pose of its weights, and these have the least energy") {
  const Limb limb(13, 8);
  const Mesh& mesh = limb.mesh;
  const std::vector<Positions> examples = {limb.bent(80, 0.4),
                                           limb.swollen(limb.bent(70, 0.8, 90))};
  const Handled handles(limb, {triangle_at(limb, 6, 2), triangle_at(limb, 10, 5)});
  // Handles where no blend of the examples puts them.
  std::vector<Affine> motions = handles.at(mesh, limb.bent(50, 0.6, 40));
  motions[1].col(3) += Eigen::Vector3d(0.1, -0.1, 0.05);
  Positions held = mesh.positions;
  for (int v = 0; v < mesh.vertex_count(); ++v)
    if (handles.roles[v] >= 0)
      held.row(v) = test::transformed(motions[handles.roles[v]], held.row(v));
  Deformer deformer(mesh, handles.roles, 2, with(examples));
  UpdateOptions options = posed();
  options.of_method.example_stiffness = 0.01;  // small: the dense energy leaves it out
  const Positions result = surface(deformer, motions, options);
  const std::vector<double> found = deformer.findings(MethodKind::examples).example_weights;
  const Eigen::Map<const Eigen::VectorXd> weights(found.data(), 2);

  const auto op = test::dense_operators(mesh.positions, mesh.triangles);
  const auto pose = [&](const Eigen::VectorXd& w) {
    return dense_pose(mesh, op, handles.roles, examples, held, w);
  };
  const DensePose best = pose(weights);
  CHECK(test::largest_difference(result, best.positions) < 1e-9);
  for (int direction = 0; direction < 8; ++direction) {
    const double angle = test::radians(45 * direction);
    const Eigen::Vector2d off(0.03 * std::cos(angle), 0.03 * std::sin(angle));
    CHECK(pose(weights + off).energy > best.energy);
  }
  CHECK(best.energy > 1e-3);
  CHECK(best.energy < 0.8 * pose(Eigen::VectorXd::Zero(2)).energy);
}

TEST_CASE("EXAMPLES doesn't depend on unit, place, orientation or numbering") {
  const ThreePoses poses;
  const Mesh& mesh = poses.limb.mesh;
  const std::vector<int>& roles = poses.handles.roles;
  const std::vector<Affine> motions = poses.handles.at(mesh, poses.limb.bent(70, 0.7, 60));
  Deformer plain(mesh, roles, 3, with(poses.examples));
  const Positions expected = surface(plain, motions, posed());
  CHECK(test::largest_difference(expected, mesh.positions) > 0.1);

  const Affine turn = test::rotation_about(0.8, {1, 2, 3}, {0.3, 0, 0}, {5, -2, 1});
  for (double scale : {1.0, 1e-4, 1e4}) {
    const auto moved = [&](const Positions& p) -> Positions {
      return scale * test::transformed(turn, p);
    };
    std::vector<Positions> examples;
    for (const Positions& example : poses.examples) examples.push_back(moved(example));
    std::vector<Affine> there;
    for (const Affine& motion : motions) {
      Eigen::Matrix4d around = Eigen::Matrix4d::Identity(), M = around;
      around.topRows<3>() = scale * turn;
      M.topRows<3>() = motion;
      there.push_back((around * M * around.inverse()).topRows<3>());
    }
    Deformer deformer({moved(mesh.positions), mesh.triangles}, roles, 3, with(examples));
    CHECK(test::largest_difference(surface(deformer, there, posed()), moved(expected)) <
          1e-6 * scale);
  }

  const test::Renumbered other = test::renumbered(mesh, roles);
  const auto renumbered = [&](const Positions& p) {
    Positions result(p.rows(), 3);
    for (Index v = 0; v < p.rows(); ++v) result.row(other.new_of_old[size_t(v)]) = p.row(v);
    return result;
  };
  std::vector<Positions> examples;
  for (const Positions& example : poses.examples) examples.push_back(renumbered(example));
  Deformer deformer(other.mesh, other.roles, 3, with(examples));
  CHECK(test::largest_difference(surface(deformer, motions, posed()), renumbered(expected)) < 1e-6);
}

TEST_CASE("EXAMPLES: triangles without area, at rest or in an example, are met like the others") {
  ThreePoses poses;
  Mesh mesh = poses.limb.mesh;
  const auto onto_edge = [&](Positions& p, int triangle) {
    const auto t = mesh.triangles.row(triangle);
    p.row(t[2]) = 0.5 * (p.row(t[0]) + p.row(t[1]));
  };
  const int at_rest = triangle_at(poses.limb, 18, 0), there = triangle_at(poses.limb, 26, 6);
  onto_edge(mesh.positions, at_rest);
  for (Positions& example : poses.examples) onto_edge(example, there);
  Deformer deformer(mesh, poses.handles.roles, 3, with(poses.examples));
  REQUIRE(deformer.degenerate_triangles().size() == 1);
  for (size_t i = 0; i < 3; ++i)
    CHECK(test::largest_difference(
              surface(deformer, poses.handles.at(mesh, poses.examples[i]), posed()),
              poses.examples[i]) < 1e-4 * box(mesh));
}

TEST_CASE("EXAMPLES: stiffness keeps weights back, far handles don't make them explode") {
  const ThreePoses poses;
  const Mesh& mesh = poses.limb.mesh;
  Deformer deformer(mesh, poses.handles.roles, 3, with(poses.examples));
  std::vector<Affine> far = poses.handles.at(mesh, poses.examples[0]);
  for (Affine& motion : far) motion.col(3) += Eigen::Vector3d(20, 0, 0);
  CHECK(surface(deformer, far, posed()).allFinite());
  double largest = 0;
  for (double weight : deformer.findings(MethodKind::examples).example_weights)
    largest = std::max(largest, std::abs(weight));
  CHECK(largest < 10);
  UpdateOptions stiff = posed();
  stiff.of_method.example_stiffness = 1e4;
  surface(deformer, far, stiff);
  double kept = 0;
  for (double weight : deformer.findings(MethodKind::examples).example_weights)
    kept = std::max(kept, std::abs(weight));
  CHECK(kept < 0.5 * largest);
}
