// SPDX-License-Identifier: GPL-3.0-or-later
#include "catch.h"
#include "deform/split_motion.h"
#include "limbs.h"

using namespace dd;
using test::Affine;
using test::box;
using test::Handled;
using test::Limb;
using test::posed;
using test::posed_by;
using test::surface;
using test::ThreePoses;
using test::triangle_at;
using test::with;

namespace {

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

TEST_CASE("EXAMPLES by given weights: handles are ignored, fixed vertices stay") {
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
    CHECK(deformer.findings(MethodKind::examples).example_weights == weights);
  }
  const Positions half = surface(deformer, away, posed_by({0.5, 0, 0}));
  CHECK(test::largest_difference(half, poses.limb.bent(40, 0.5)) < 0.01 * box(mesh));

  // Afterwards the handles place the surface as if no weights had been given.
  const std::vector<Affine> motions = poses.handles.at(mesh, poses.limb.bent(70, 0.7, 60));
  Deformer fresh(mesh, poses.handles.roles, 3, with(poses.examples));
  CHECK(test::largest_difference(surface(deformer, motions, posed()),
                                 surface(fresh, motions, posed())) == 0);
}

TEST_CASE(
    "EXAMPLES by given weights: a part without fixed vertices follows the examples' centres") {
  const Mesh ball = test::rough_sphere(3, 0.1);
  std::vector<int> roles(static_cast<size_t>(ball.vertex_count()), kFree);
  roles[0] = 0;
  const double quarter = std::acos(0.0);
  const Affine turn = test::rotation_about(quarter, {0, 0, 1}, {0.5, 0, 0}, {0, 2, 3});
  const Positions turned = test::transformed(turn, ball.positions);
  BindOptions how = with({turned});
  how.triangulation = Triangulation::given;  // the centre below is that of the given triangles
  Deformer deformer(ball, roles, 1, how);
  CHECK(test::largest_difference(surface(deformer, {test::identity()}, posed_by({1})), turned) <
        1e-9);
  // Half of the weight: half of the turn, the centre half-way.
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

TEST_CASE("EXAMPLES: rotation_only takes an example's bends but not its stretch") {
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

TEST_CASE("EXAMPLES: the number of threads changes nothing", "[threads]") {
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

TEST_CASE("EXAMPLES: unusable examples and weights are refused with a message") {
  const Limb limb(9, 6);
  const std::vector<int> roles = test::ends_held(limb.mesh, 0.01, 0.99);
  const auto blame = [&](const std::vector<Positions>& examples) {
    return test::refusal([&] { Deformer(limb.mesh, roles, 1, with(examples)); }, Status::argument);
  };
  const Positions& p = limb.mesh.positions;
  CHECK_THAT(blame({p, p.topRows(20)}), contains("Example 1 has 20 vertices, the mesh 56"));
  Positions broken = p;
  broken(7, 1) = std::nan("");
  CHECK_THAT(blame({p, p, broken}), contains("Example 2 has a coordinate, of vertex 7,"));
  broken(7, 1) = 1e35;
  CHECK_THAT(blame({broken}), contains("Example 0 has a coordinate, of vertex 7,"));

  Deformer deformer(limb.mesh, roles, 1, with({limb.bent(30, 0.5)}));
  const auto refused = [&](const std::vector<double>& weights) {
    return test::refusal([&] { surface(deformer, {test::identity()}, posed_by(weights)); },
                         Status::argument);
  };
  CHECK_THAT(refused({1, 2}), contains("There are 2 example weights, but 1 examples"));
  CHECK_THAT(refused({}), contains("There are 0 example weights"));
  CHECK_THAT(refused({std::nan("")}), contains("Example 0 has a weight that is not finite"));
  SplitMotion motion;
  const Affine still = test::identity();
  motion.matrices.assign(still.data(), still.data() + 12);
  motion.steps = 2;
  CHECK_THAT(test::refusal([&] { split_update(deformer, motion, posed()); }, Status::argument),
             contains("one step"));
}

TEST_CASE("EXAMPLES: a handle out of reach doesn't turn a bulge into a pinch") {
  const Limb limb;
  Positions bulge = limb.mesh.positions;
  for (Index v = 0; v < bulge.rows(); ++v)
    bulge.row(v).head<2>() *= 1 + 0.8 * std::exp(-std::pow((bulge(v, 2) - 0.5) / 0.15, 2));
  Deformer deformer(limb.mesh, test::ends_held(limb.mesh, 0.1, 0.95), 1,
                    with({limb.bent(100, 0.7), bulge}));
  for (const double aside : {0.3, 0.6, 0.9}) {
    Affine moved = test::identity();  // without the turn of a bend
    moved.col(3) << aside, 0, -0.5 * aside;
    surface(deformer, {moved}, posed());
    const std::vector<double> weights = deformer.findings(MethodKind::examples).example_weights;
    CHECK(weights[0] > 0.1);
    for (const double weight : weights) {
      CHECK(weight > -0.4);
      CHECK(weight < 1.4);
    }
  }
}
