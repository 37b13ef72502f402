// SPDX-License-Identifier: GPL-3.0-or-later
#include "systems/tets.h"

#include <Eigen/Dense>
#include <cmath>
#include <random>

#include "cases.h"
#include "catch.h"
#include "deform.h"
#include "dense_reference.h"

using namespace dd;
using test::Affine;
using test::by;

namespace {

/// A block of cubes, each cut into six tetrahedra, its vertices shaken.
TetMesh shaken_block(int side, double amount, unsigned seed) {
  TetMesh mesh;
  const auto number = [side](int i, int j, int k) { return (i * side + j) * side + k; };
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-amount, amount);
  mesh.positions.resize(side * side * side, 3);
  for (int i = 0; i < side; ++i)
    for (int j = 0; j < side; ++j)
      for (int k = 0; k < side; ++k)
        mesh.positions.row(number(i, j, k)) << i + uniform(random), j + uniform(random),
            k + uniform(random);
  std::vector<std::array<int, 4>> tets;
  const int paths[6][3] = {{0, 1, 2}, {0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}};
  for (int i = 0; i + 1 < side; ++i)
    for (int j = 0; j + 1 < side; ++j)
      for (int k = 0; k + 1 < side; ++k)
        for (const auto& path : paths) {
          int at[3] = {i, j, k};
          std::array<int, 4> tet{number(i, j, k)};
          for (int step = 0; step < 3; ++step) {
            ++at[path[step]];
            tet[size_t(step) + 1] = number(at[0], at[1], at[2]);
          }
          tets.push_back(tet);
        }
  mesh.tets.resize(Index(tets.size()), 4);
  for (size_t j = 0; j < tets.size(); ++j)
    for (int k = 0; k < 4; ++k) mesh.tets(Index(j), k) = tets[j][size_t(k)];
  return mesh;
}

/// G and D by other formulas than the core's: a tetrahedron's corners, with ones, are a 4×4 matrix
/// whose inverse holds the gradients of the barycentric coordinates, and whose determinant is six
/// times the volume.
struct DenseTets {
  Eigen::MatrixXd G, D;
  explicit DenseTets(const TetMesh& mesh)
      : G(Eigen::MatrixXd::Zero(3 * mesh.tet_count(), mesh.vertex_count())),
        D(Eigen::MatrixXd::Zero(G.rows(), G.rows())) {
    for (Index j = 0; j < mesh.tet_count(); ++j) {
      Eigen::Matrix4d corners = Eigen::Matrix4d::Ones();
      for (int k = 0; k < 4; ++k) corners.block<1, 3>(k, 0) = mesh.positions.row(mesh.tets(j, k));
      const Eigen::Matrix4d inverse = corners.inverse();
      for (int k = 0; k < 4; ++k)
        G.block<3, 1>(3 * j, mesh.tets(j, k)) += inverse.block<3, 1>(0, k);
      D.block<3, 3>(3 * j, 3 * j) =
          std::abs(corners.determinant()) / 6 * Eigen::Matrix3d::Identity();
    }
  }
};

/// Both ends along x held: one fixed, one handle 0.
std::vector<int> ends(const TetMesh& mesh, int side) {
  std::vector<int> roles;
  for (int v = 0; v < mesh.vertex_count(); ++v) {
    const int i = v / (side * side);
    roles.push_back(i == 0 ? kFixed : i == side - 1 ? 0 : kFree);
  }
  return roles;
}

}  // namespace

TEST_CASE("section 4: the operator of deformation transfer is the gradient, entry by entry") {
  for (unsigned seed : {1u, 2u, 3u}) {
    const TetMesh mesh = shaken_block(4, 0.12, seed);
    const Eigen::MatrixXd G = gradient(mesh), other = deformation_operator(mesh);
    CHECK((G - other).cwiseAbs().maxCoeff() < 1e-12 * G.cwiseAbs().maxCoeff());
  }
}

TEST_CASE("gradients of linear functions are exact, volumes sum to the block's") {
  const TetMesh mesh = shaken_block(4, 0.12, 5);
  const Eigen::Matrix3d A = Eigen::Matrix3d::Random();
  const RowMatrix gradients = gradient(mesh) * RowMatrix(mesh.positions * A.transpose());
  for (Index j = 0; j < mesh.tet_count(); ++j)
    CHECK((gradients.middleRows<3>(3 * j) - A.transpose()).norm() < 1e-12);
  const TetMesh regular = shaken_block(4, 0, 1);
  CHECK(volumes(regular).sum() == Approx(27));
}

TEST_CASE("the Poisson system equals a dense one and reproduces positions from their gradients") {
  const int side = 4;
  const TetMesh mesh = shaken_block(side, 0.12, 7);
  const auto roles = ends(mesh, side);
  const TetPoisson poisson(mesh, roles, 1, gradient(mesh), volumes(mesh));
  const Affine motion = test::rotation_about(0.8, {1, 2, 3}, {0, 0, 0}, {1, 2, 3});
  Positions bent = test::transformed(motion, mesh.positions);
  bent.col(0).array() += 0.1 * mesh.positions.col(1).array().square();
  const RowMatrix gradients = gradient(mesh) * RowMatrix(bent);
  CHECK((poisson.solve(bent, gradients) - bent).cwiseAbs().maxCoeff() < 1e-10);

  std::srand(3);
  const RowMatrix wanted = RowMatrix::Random(3 * mesh.tet_count(), 3);
  const DenseTets dense(mesh);
  CHECK((Eigen::MatrixXd(gradient(mesh)) - dense.G).cwiseAbs().maxCoeff() < 1e-12);
  const Eigen::MatrixXd div = dense.G.transpose() * dense.D;
  const Positions expected = test::dense_solve(div * dense.G, bent, roles, div * wanted);
  CHECK(test::largest_difference(poisson.solve(bent, wanted), expected) < 1e-9);
}

TEST_CASE("editing a solid by gradients: rest, a common rotation, and a translation's flaw") {
  const int side = 4;
  const TetMesh mesh = shaken_block(side, 0.12, 9);
  auto roles = ends(mesh, side);
  const TetPoisson poisson(mesh, roles, 1, gradient(mesh), volumes(mesh));
  CHECK(test::largest_difference(
            edit_by_gradients(poisson, mesh, roles, 1, test::identity().data()), mesh.positions) <
        1e-12);
  Affine shift = test::identity();
  shift.col(3) << 0, 0, 1;
  const Positions shifted = edit_by_gradients(poisson, mesh, roles, 1, shift.data());
  const RowMatrix weights = poisson.harmonic_weights();
  CHECK(test::largest_difference(shifted - mesh.positions, weights * Eigen::RowVector3d(0, 0, 1)) <
        1e-10);
  roles = test::held_by_one(roles);
  const TetPoisson held(mesh, roles, 1, gradient(mesh), volumes(mesh));
  Affine motion = test::rotation_about(1.2, {1, 2, 3}, {0, 0, 0}, {1, 2, 3});
  motion.leftCols<3>() *= 1.3;
  CHECK(test::largest_difference(edit_by_gradients(held, mesh, roles, 1, motion.data()),
                                 test::transformed(motion, mesh.positions)) < 1e-9);
}

TEST_CASE("a solid without handles rests") {
  const TetMesh mesh = shaken_block(3, 0.1, 4);
  auto roles = ends(mesh, 3);
  for (int& role : roles) role = role == kFree ? kFree : kFixed;
  const TetPoisson poisson(mesh, roles, 0, gradient(mesh), volumes(mesh));
  CHECK(poisson.harmonic_weights().cols() == 0);
  CHECK(edit_by_gradients(poisson, mesh, roles, 0, nullptr) == mesh.positions);
}

TEST_CASE("unusable solids are refused with the vertex or tetrahedron") {
  TetMesh mesh = shaken_block(3, 0, 1);
  auto roles = ends(mesh, 3);
  const auto refused = [&] {
    return test::refusal(
        [&] {
          validate(mesh);
          TetPoisson(mesh, roles, 1, gradient(mesh), volumes(mesh));
        },
        Status::mesh);
  };
  mesh.tets(7, 2) = mesh.tets(7, 1);
  CHECK_THAT(refused(), contains("Tetrahedron 7 has no volume"));
  mesh.tets(7, 2) = 99;
  CHECK_THAT(refused(), contains("Tetrahedron 7 refers to vertex 99"));
  mesh = shaken_block(3, 0, 1);
  const auto refused_roles = [&](const std::vector<int>& given, int handle_count) {
    return test::refusal(
        [&] { TetPoisson(mesh, given, handle_count, gradient(mesh), volumes(mesh)); },
        Status::region);
  };
  CHECK_THAT(refused_roles(std::vector<int>(27, kFree), 0), contains("Nothing holds"));
  // A handle without vertices would take memory, too.
  CHECK_THAT(refused_roles(roles, 2), contains("Handle 1 has no vertices"));
  CHECK_THAT(refused_roles(roles, 2000000000), contains("more handles than vertices"));
}

TEST_CASE("a formulation that can't be solved for leaves the one before usable") {
  // Inner vertices are drawn together: weighted by volume, their tiny tetrahedra can be solved for.
  bool refused = false;
  for (int side : {4, 5})
    for (double drawn : {1e-6, 1e-7}) {
      Mesh sheet = test::grid(side, side, [](double, double) { return 0.0; });
      std::vector<int> roles(static_cast<size_t>(side * side), kFixed);
      for (int i = 1; i + 1 < side; ++i)
        for (int j = 1; j + 1 < side; ++j) {
          const int v = i * side + j;
          roles[v] = kFree;
          sheet.positions.row(v) << 0.5 + drawn * (sheet.positions(v, 0) - 0.5),
              0.5 + drawn * (sheet.positions(v, 1) - 0.5), 0;
        }
      for (int j = 0; j < side; ++j) roles[(side - 1) * side + j] = 0;
      Deformer deformer(sheet, roles, 1, {});
      UpdateOptions by_volumes = by(MethodKind::detail), unweighted = by_volumes;
      by_volumes.of_method.formulation = Formulation::fourth_points;
      unweighted.of_method.formulation = Formulation::fourth_points_unweighted;
      const Positions before = test::surface(deformer, {test::identity()}, by_volumes);
      try {
        test::surface(deformer, {test::identity()}, unweighted);
      } catch (const Error&) {
        refused = true;
      }
      CHECK(test::surface(deformer, {test::identity()}, by_volumes) == before);
    }
  CHECK(refused);
}

TEST_CASE("transfer by fourth points comes close to the surface formulation on the bumpy plane") {
  const auto plane = test::lifted_plane(81);
  Deformer deformer(plane.mesh, plane.roles, 1, {});
  for (bool rotation_only : {true, false}) {
    const Positions by_surface =
        test::surface(deformer, {plane.motion}, by(MethodKind::detail, rotation_only));
    UpdateOptions options = by(MethodKind::detail, rotation_only);
    options.of_method.formulation = Formulation::fourth_points;
    const Positions by_volume = test::surface(deformer, {plane.motion}, options);
    const double difference = test::largest_difference(by_volume, by_surface) /
                              bounding_box_diagonal(plane.mesh.positions);
    INFO(difference);
    CHECK(difference < 1e-3);
    CHECK(difference > 1e-12);
    options.of_method.formulation = Formulation::fourth_points_unweighted;
    CHECK(test::largest_difference(test::surface(deformer, {plane.motion}, options), by_surface) <
          2e-2);
  }
}

TEST_CASE("fourth points weighted by volumes are the Poisson system of the tetrahedra: §4") {
  const Mesh mesh = test::rough_sphere(2, 0.15);
  const auto roles = test::roles_by_height(mesh, -0.5, 0.7);
  const Affine motion = test::rotation_about(0.6, {1, 0.3, 0}, {0, 0, 1}, {0.2, 0.1, 0.4});
  Deformer deformer(mesh, roles, 1, {});
  for (bool rotation_only : {true, false}) {
    UpdateOptions options = by(MethodKind::detail, rotation_only);
    options.of_method.formulation = Formulation::fourth_points;
    const Positions result = test::surface(deformer, {motion}, options);
    // The same over all triangles, on dense matrices. A fourth point is over the first corner, at
    // the height √(2 area) along the normal.
    const int n = mesh.vertex_count(), m = mesh.triangle_count();
    TetMesh solid{mesh.positions, Tetrahedra(m, 4)};
    solid.positions.conservativeResize(n + m, 3);
    for (int j = 0; j < m; ++j) {
      const auto corner = mesh.triangles.row(j);
      const Eigen::Vector3d a = mesh.positions.row(corner[0]), b = mesh.positions.row(corner[1]),
                            c = mesh.positions.row(corner[2]);
      const double l = (b - a).norm(), along = (c - a).dot(b - a) / l;
      const double height = std::sqrt((c - a).squaredNorm() - along * along);
      solid.positions.row(n + j) =
          a + std::sqrt(l * height) * test::triangle_normal(mesh.positions, mesh.triangles, j);
      solid.tets.row(j) << corner[0], corner[1], corner[2], n + j;
    }
    std::vector<int> solid_roles = roles;
    solid_roles.resize(static_cast<size_t>(n + m), kFree);
    const DenseTets dense(solid);
    Eigen::MatrixXd gradients(3 * m, 3);
    const Positions base = deformer.base(), deformed_base = deformer.deformed_base();
    for (Index j = 0; j < mesh.triangles.rows(); ++j) {
      Eigen::Matrix3d S = test::deformation_gradient(base, deformed_base, mesh.triangles, j);
      if (rotation_only) S = test::polar_rotation(S);
      gradients.middleRows<3>(3 * j) = S.transpose();
    }
    Positions constrained = solid.positions;
    for (int v = 0; v < mesh.vertex_count(); ++v)
      if (roles[v] == 0) constrained.row(v) = test::transformed(motion, mesh.positions.row(v));
    const Eigen::MatrixXd div = dense.G.transpose() * dense.D;
    const Positions expected =
        test::dense_solve(div * dense.G, constrained, solid_roles, div * gradients);
    CHECK(test::largest_difference(result, expected.topRows(n)) < 1e-9);
  }
}
