// SPDX-License-Identifier: GPL-3.0-or-later
#include <Eigen/Dense>

#include "cases.h"
#include "catch.h"
#include "deform.h"
#include "dense_reference.h"
#include "split_motion.h"

using namespace dd;
using test::Affine;
using test::surface;

namespace {

UpdateOptions posed() { return test::by(MethodKind::examples, false); }

UpdateOptions posed_by(const std::vector<double>& weights) {
  UpdateOptions options = posed();
  options.of_method.example_weights = weights;
  return options;
}

BindOptions with(const std::vector<Positions>& examples, Precision precision = Precision::full) {
  BindOptions options;
  options.examples = examples;
  options.precision = precision;
  return options;
}

/// A limb along z from 0 to 1.6, its rings and their sides.
struct Limb {
  int rings, sides;
  Mesh mesh;
  explicit Limb(int ring_count = 33, int side_count = 12)
      : rings(ring_count), sides(side_count), mesh(test::tube(rings, sides, [](double u, double v) {
          return Eigen::RowVector3d(0.1 * std::cos(v), 0.1 * std::sin(v), 1.6 * u);
        })) {}

  Positions bent(double degrees, double joint, double turned_about_z = 0) const {
    Positions p = mesh.positions;
    const Affine turn =
        test::rotation_about(test::radians(turned_about_z), {0, 0, 1}, {0, 0, 0}, {0, 0, 0});
    const Affine back =
        test::rotation_about(-test::radians(turned_about_z), {0, 0, 1}, {0, 0, 0}, {0, 0, 0});
    p = test::transformed(back, p);
    const double length = 0.2, angle = test::radians(degrees), radius = length / angle;
    for (Index v = 0; v < p.rows(); ++v) {
      const double along = std::clamp(p(v, 2) - joint, 0.0, length);
      const double rest = std::max(0.0, p(v, 2) - joint - length);
      if (p(v, 2) <= joint) continue;
      const double t = along / radius, arm = radius - p(v, 0);
      p(v, 0) = radius - arm * std::cos(t) + std::sin(t) * rest;
      p(v, 2) = joint + arm * std::sin(t) + std::cos(t) * rest;
    }
    return test::transformed(turn, p);
  }

  /// Turned about its length, more and more towards the top.
  Positions twisted(double degrees) const {
    Positions p = mesh.positions;
    for (Index v = 0; v < p.rows(); ++v) {
      const Eigen::Rotation2Dd turn(test::radians(degrees) * p(v, 2) / 1.6);
      p.row(v).head<2>() = (turn * p.row(v).head<2>().transpose()).transpose();
    }
    return p;
  }

  /// Wider about the middle, along x.
  Positions swollen(const Positions& p) const {
    Positions result = p;
    for (Index v = 0; v < p.rows(); ++v)
      result(v, 0) *= 1 + std::exp(-40 * std::pow(mesh.positions(v, 2) - 0.8, 2));
    return result;
  }

  Eigen::RowVector3d centre(const Positions& p, int ring) const {
    return p.middleRows(ring * sides, sides).colwise().mean();
  }
};

/// The affine motion of a triangle from p to q, with (15).
Affine motion_of(const Mesh& mesh, const Positions& q, int triangle) {
  Affine motion;
  motion.leftCols<3>() = test::deformation_gradient(mesh.positions, q, mesh.triangles, triangle);
  const int v = mesh.triangles(triangle, 0);
  motion.col(3) = q.row(v).transpose() - motion.leftCols<3>() * mesh.positions.row(v).transpose();
  return motion;
}

/// The bottom fixed, and single triangles as handles.
struct Handled {
  std::vector<int> roles, triangles;
  Handled(const Limb& limb, const std::vector<int>& their_triangles)
      : roles(static_cast<size_t>(limb.mesh.vertex_count()), kFree), triangles(their_triangles) {
    for (int v = 0; v < limb.mesh.vertex_count(); ++v)
      if (limb.mesh.positions(v, 2) < 0.11) roles[v] = kFixed;
    for (size_t h = 0; h < triangles.size(); ++h)
      for (int k = 0; k < 3; ++k) roles[limb.mesh.triangles(triangles[h], k)] = int(h);
  }
  int count() const { return static_cast<int>(triangles.size()); }
  std::vector<Affine> at(const Mesh& mesh, const Positions& q) const {
    std::vector<Affine> motions;
    for (int triangle : triangles) motions.push_back(motion_of(mesh, q, triangle));
    return motions;
  }
};

/// tube() lists, for each side, two triangles between any two rings and then the two caps'.
int triangle_at(const Limb& limb, int ring, int side) { return side * 2 * limb.rings + 2 * ring; }

struct ThreePoses {
  Limb limb;
  std::vector<Positions> examples = {limb.bent(80, 0.5), limb.swollen(limb.bent(100, 0.9, 90)),
                                     limb.bent(60, 1.1, 200)};
  Handled handles{limb,
                  {triangle_at(limb, 14, 2), triangle_at(limb, 22, 7), triangle_at(limb, 30, 4)}};
};

Eigen::Matrix3d logarithm(const Eigen::Matrix3d& R) {
  const double angle = std::acos(std::min(1.0, (R.trace() - 1) / 2));
  return angle < 1e-7 ? Eigen::Matrix3d(0.5 * (R - R.transpose()))
                      : Eigen::Matrix3d(angle / (2 * std::sin(angle)) * (R - R.transpose()));
}

/// By series: another way than the core's.
Eigen::Matrix3d exponential(const Eigen::Matrix3d& A) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Identity(), term = sum;
  for (int k = 1; k < 40; ++k) sum += term = (term * A / k).eval();
  return sum;
}

/// Energy and positions for given weights, all dense.
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

double box(const Mesh& mesh) { return bounding_box_diagonal(mesh.positions); }

double longest_stretch(const Mesh& mesh, const Positions& p) {
  double longest = 0;
  for (Index j = 0; j < mesh.triangles.rows(); ++j)
    for (int k = 0; k < 3; ++k) {
      const int a = mesh.triangles(j, k), b = mesh.triangles(j, (k + 1) % 3);
      longest = std::max(longest, (p.row(a) - p.row(b)).norm() /
                                      (mesh.positions.row(a) - mesh.positions.row(b)).norm());
    }
  return longest;
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
        CHECK(deformer.example_weights()[k] == Approx(k == i ? 1 : 0).margin(1e-3));
    }
    CHECK(test::largest_difference(
              surface(deformer, poses.handles.at(mesh, mesh.positions), posed()), mesh.positions) <
          1e-12);
    for (double weight : deformer.example_weights()) CHECK(std::abs(weight) < 1e-9);
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
        .norm();  // of what is straight beyond the joint
  };
  CHECK(length(result) == Approx(length(limb.mesh.positions)).epsilon(0.01));
  CHECK(deformer.example_weights()[0] == Approx(0.5).margin(0.02));
  CHECK(test::largest_difference(result, half) < 0.01 * box(limb.mesh));
  // What blending positions makes of it.
  const Positions blended = 0.5 * (limb.mesh.positions + bent);
  CHECK(length(blended) == Approx(0.5 * length(limb.mesh.positions)).epsilon(0.01));
}

TEST_CASE("EXAMPLES: a half turn is found, though from the rest no slope leads there") {
  const Limb limb;
  const Positions bent = limb.bent(180, 0.5);
  Handled handles(limb, {triangle_at(limb, 30, 3), triangle_at(limb, 30, 9)});
  Deformer deformer(limb.mesh, handles.roles, 2, with({bent}));
  CHECK(test::largest_difference(surface(deformer, handles.at(limb.mesh, bent), posed()), bent) <
        1e-4 * box(limb.mesh));
}

TEST_CASE(
    "EXAMPLES without any, or with the rest as one, is the Poisson solve with S's gradients") {
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
    CHECK(deformer.example_weights().size() == examples.size());
  }
}

TEST_CASE("EXAMPLES: the result is the pose of its weights, and these have the least energy") {
  const Limb limb(13, 8);
  const Mesh& mesh = limb.mesh;
  const std::vector<Positions> examples = {limb.bent(80, 0.4),
                                           limb.swollen(limb.bent(70, 0.8, 90))};
  const Handled handles(limb, {triangle_at(limb, 6, 2), triangle_at(limb, 10, 5)});
  // Where neither example nor any blend of them is.
  std::vector<Affine> motions = handles.at(mesh, limb.bent(50, 0.6, 40));
  motions[1].col(3) += Eigen::Vector3d(0.1, -0.1, 0.05);
  Positions held = mesh.positions;
  for (int v = 0; v < mesh.vertex_count(); ++v)
    if (handles.roles[v] >= 0)
      held.row(v) = test::transformed(motions[handles.roles[v]], held.row(v));
  Deformer deformer(mesh, handles.roles, 2, with(examples));
  const Positions result = surface(deformer, motions, posed());
  const std::vector<double> found = deformer.example_weights();
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

TEST_CASE("EXAMPLES: a limb twisted by more than half a turn interpolates along the twist") {
  Limb limb(65, 16);
  limb.mesh.positions.leftCols<2>() *= 0.2;  // so that the twist shears little
  std::vector<int> roles = test::ends_held(limb.mesh, 0.01, 0.99);
  for (double degrees : {270.0, 420.0, 720.0}) {
    const Positions twisted = limb.twisted(degrees);
    Deformer deformer(limb.mesh, roles, 1, with({twisted}));
    for (double weight : {0.25, 0.5, 0.75}) {
      const Positions part = surface(deformer, {test::identity()}, posed_by({weight}));
      const Positions expected = limb.twisted(weight * degrees);
      CHECK(test::largest_difference(part, expected) < 0.05 * box(limb.mesh));
      CHECK(longest_stretch(limb.mesh, part) < longest_stretch(limb.mesh, twisted) + 1e-3);
      for (int ring : {16, 32, 48, 60}) {
        const auto spoke = [&](const Positions& p) -> Eigen::RowVector3d {
          return (p.row(ring * limb.sides) - limb.centre(p, ring)).normalized();
        };
        CHECK(spoke(part).dot(spoke(expected)) > std::cos(test::radians(15)));
      }
    }
    CHECK(test::largest_difference(surface(deformer, {test::identity()}, posed_by({1})), twisted) <
          1e-9);
  }
}

TEST_CASE("EXAMPLES by given weights: handles are let go, what is fixed stays") {
  const ThreePoses poses;
  const Mesh& mesh = poses.limb.mesh;
  Deformer deformer(mesh, poses.handles.roles, 3, with(poses.examples));
  const std::vector<Affine> away(3, test::rotation_about(1, {1, 0, 0}, {0, 0, 0}, {3, 3, 3}));
  CHECK(test::largest_difference(surface(deformer, away, posed_by({0, 0, 0})), mesh.positions) <
        1e-12);
  for (size_t i = 0; i < 3; ++i) {
    std::vector<double> weights(3, 0);
    weights[i] = 1;
    CHECK(test::largest_difference(surface(deformer, away, posed_by(weights)), poses.examples[i]) <
          1e-9);
    CHECK(deformer.example_weights() == weights);
  }
  const Positions half = surface(deformer, away, posed_by({0.5, 0, 0}));
  CHECK(test::largest_difference(half, poses.limb.bent(40, 0.5)) < 0.01 * box(mesh));

  // Back to the handles, without a trace.
  const std::vector<Affine> motions = poses.handles.at(mesh, poses.limb.bent(70, 0.7, 60));
  Deformer fresh(mesh, poses.handles.roles, 3, with(poses.examples));
  CHECK(test::largest_difference(surface(deformer, motions, posed()),
                                 surface(fresh, motions, posed())) == 0);
}

TEST_CASE("EXAMPLES by given weights: what nothing fixes goes where the examples' centres do") {
  const Mesh ball = test::rough_sphere(3, 0.1);
  std::vector<int> roles(static_cast<size_t>(ball.vertex_count()), kFree);
  roles[0] = 0;
  const double quarter = std::acos(0.0);
  const Affine turn = test::rotation_about(quarter, {0, 0, 1}, {0.5, 0, 0}, {0, 2, 3});
  const Positions turned = test::transformed(turn, ball.positions);
  Deformer deformer(ball, roles, 1, with({turned}));
  CHECK(test::largest_difference(surface(deformer, {test::identity()}, posed_by({1})), turned) <
        1e-9);
  // Half: turned by half of it, its centre half-way.
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double whole = 0;
  for (Index j = 0; j < ball.triangles.rows(); ++j) {
    const Eigen::Vector3d a = ball.positions.row(ball.triangles(j, 0)),
                          b = ball.positions.row(ball.triangles(j, 1)),
                          c = ball.positions.row(ball.triangles(j, 2));
    const double area = (b - a).cross(c - a).norm();
    centre += area * (a + b + c) / 3;
    whole += area;
  }
  centre /= whole;
  const Eigen::Vector3d there = turn.leftCols<3>() * centre + turn.col(3);
  const Affine half = test::rotation_about(quarter / 2, {0, 0, 1}, centre, 0.5 * (there - centre));
  CHECK(test::largest_difference(surface(deformer, {test::identity()}, posed_by({0.5})),
                                 test::transformed(half, ball.positions)) < 1e-9);
}

TEST_CASE("EXAMPLES: rotation_only bends but doesn't swell") {
  const Limb limb;
  std::vector<int> roles = test::ends_held(limb.mesh, 0.01, 0.99);
  Positions longer = limb.mesh.positions;
  longer.col(2) *= 1.5;
  Deformer deformer(limb.mesh, roles, 1, with({longer, limb.twisted(90)}));
  UpdateOptions options = posed_by({1, 0});
  CHECK(test::largest_difference(surface(deformer, {test::identity()}, options), longer) < 1e-9);
  options.of_method.rotation_only = true;
  CHECK(test::largest_difference(surface(deformer, {test::identity()}, options),
                                 limb.mesh.positions) < 1e-9);
  options.of_method.example_weights = {0, 1};
  CHECK(test::largest_difference(surface(deformer, {test::identity()}, options), limb.twisted(90)) <
        0.01);
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
  for (double weight : deformer.example_weights()) largest = std::max(largest, std::abs(weight));
  CHECK(largest < 10);
  UpdateOptions stiff = posed();
  stiff.of_method.example_stiffness = 1e4;
  surface(deformer, far, stiff);
  double kept = 0;
  for (double weight : deformer.example_weights()) kept = std::max(kept, std::abs(weight));
  CHECK(kept < 0.5 * largest);
}

TEST_CASE("EXAMPLES: the number of threads changes nothing") {
  const Limb limb(161, 40);
  const std::vector<Positions> examples = {limb.bent(80, 0.5), limb.bent(60, 1.0, 90)};
  const Handled handles(limb, {triangle_at(limb, 150, 5), triangle_at(limb, 150, 25)});
  const std::vector<Affine> motions = handles.at(limb.mesh, limb.bent(70, 0.7, 40));
  std::vector<Positions> results;
  for (int threads : {1, 2, 5}) {
    BindOptions options = with(examples, Precision::single);
    options.threads = threads;
    Deformer deformer(limb.mesh, handles.roles, 2, options);
    results.push_back(surface(deformer, motions, posed()));
    results.push_back(surface(deformer, motions, posed_by({0.3, 0.6})));
  }
  for (size_t k = 2; k < results.size(); ++k)
    CHECK(test::largest_difference(results[k], results[k % 2]) == 0);
}

TEST_CASE("EXAMPLES: what can't be used is refused with a sentence") {
  const Limb limb(9, 6);
  const std::vector<int> roles = test::ends_held(limb.mesh, 0.01, 0.99);
  const auto blame = [&](const std::vector<Positions>& examples) {
    return test::refusal([&] { Deformer(limb.mesh, roles, 1, with(examples)); }, Status::argument);
  };
  const Positions& p = limb.mesh.positions;
  CHECK_THAT(blame({p, p.topRows(20)}), contains("Example 1 has 20 vertices, the mesh 56"));
  Positions broken = p;
  broken(7, 1) = std::nan("");
  CHECK_THAT(blame({p, p, broken}), contains("Example 2: vertex 7"));
  broken(7, 1) = 1e35;
  CHECK_THAT(blame({broken}), contains("Example 0: vertex 7"));

  Deformer deformer(limb.mesh, roles, 1, with({limb.bent(30, 0.5)}));
  const auto refused = [&](const std::vector<double>& weights) {
    return test::refusal([&] { surface(deformer, {test::identity()}, posed_by(weights)); },
                         Status::argument);
  };
  CHECK_THAT(refused({1, 2}), contains("There are 2 example weights, but 1 examples"));
  CHECK_THAT(refused({}), contains("There are 0 example weights"));
  CHECK_THAT(refused({std::nan("")}), contains("weight of example 0 is not finite"));
  SplitMotion motion;
  const Affine still = test::identity();
  motion.matrices.assign(still.data(), still.data() + 12);
  motion.steps = 2;
  CHECK_THAT(test::refusal([&] { split_update(limb.mesh, roles, 1, with({p}), motion, posed()); },
                           Status::argument),
             contains("one step"));
}
