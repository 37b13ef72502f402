// SPDX-License-Identifier: GPL-3.0-or-later
#include "reconstruction/gradients.h"

#include <Eigen/Dense>
#include <numeric>

#include "catch.h"
#include "dense_reference.h"
#include "meshes.h"
#include "systems/free_block.h"
#include "systems/operators.h"

using namespace dd;

namespace {

/// div(Sᵀ) by a GradientPass with every vertex free, n×3.
Positions divergence_by_pass(const Mesh& surface, const Positions& base, const Positions& deformed,
                             bool rotation_only) {
  const int n = surface.vertex_count();
  const std::vector<int> all_free(static_cast<size_t>(n), kFree);
  const Region region = make_region(surface, all_free, 0, MovedBy::base);
  ThreadPool pool(1);
  BlockOptions options;
  options.pool = &pool;
  FactoredSurface factored(surface, region);
  factored.factor(free_block(factored.operators.laplacian, region), options);
  const PoissonSystem& poisson = *factored.poisson;
  const GradientPass<double> pass(factored, base, stand_ins(base, surface.triangles, 1));
  const Rows base_rows = in_order(deformed, poisson.order());
  Rows right = Rows::Zero(poisson.right_hand_side_rows(), 4);
  for (int section = 0; section < poisson.active().sections(); ++section)
    pass.add(section, base_rows.data(), rotation_only, right.data());
  Positions result(n, 3);
  for (int r = 0; r < n; ++r) result.row(poisson.order().vertex_of_row[r]) = right.row(r).head<3>();
  return result;
}

/// The number of triangles whose gradient is another one's, or none.
int with_another(const StandIns& standing) {
  int count = 0;
  for (size_t j = 0; j < standing.of_triangle.size(); ++j)
    count += standing.of_triangle[j] != static_cast<int>(j);
  return count;
}

/// A smooth base with a strong, uneven deformation.
struct Pair {
  Mesh surface = test::rough_sphere(2, 0.3);
  Positions base, deformed;
  Pair() {
    base = surface.positions.rowwise().normalized() * 0.9;
    deformed = base;
    for (Index v = 0; v < base.rows(); ++v) {
      const double x = base(v, 0), y = base(v, 1), z = base(v, 2);
      deformed.row(v) << x + 0.5 * y * y, 1.4 * y - 0.8 * z * x, 0.7 * z + 0.6 * x * y;
    }
  }
};

}  // namespace

TEST_CASE("S_j is (15), its rotation the polar one: both against inverse and SVD") {
  const Pair pair;
  const auto& t = pair.surface.triangles;
  const auto metric = triangle_metric(pair.surface.positions, t);
  const SparseMatrix div = divergence(gradient(pair.surface.positions, t), metric);
  for (bool rotation_only : {false, true}) {
    Eigen::MatrixXd gradients(3 * t.rows(), 3);
    for (Index j = 0; j < t.rows(); ++j) {
      Eigen::Matrix3d S = test::deformation_gradient(pair.base, pair.deformed, t, j);
      REQUIRE(S.determinant() > 0);
      if (rotation_only) S = test::polar_rotation(S);
      gradients.middleRows<3>(3 * j) = S.transpose();
    }
    const Eigen::MatrixXd expected = div * gradients;
    const Positions result =
        divergence_by_pass(pair.surface, pair.base, pair.deformed, rotation_only);
    CHECK((result - expected).norm() < 1e-12 * expected.norm());
  }
}

TEST_CASE("triangles of the base without area turn with a neighbour") {
  Pair pair;
  const Triangles& t = pair.surface.triangles;
  // Two triangles of a vertex collapse to a point, which leaves their neighbours without area, too.
  std::vector<int> fan;
  for (Index j = 0; j < t.rows(); ++j)
    for (int k = 0; k < 3; ++k)
      if (t(j, k) == 20) fan.push_back(int(j));
  for (int j : {fan[0], fan[1]})
    for (int k = 0; k < 3; ++k) pair.base.row(t(j, k)) = pair.base.row(20);
  const StandIns standing = stand_ins(pair.base, t, 1);
  CHECK(with_another(standing) >= 2);
  for (Index j = 0; j < t.rows(); ++j) {
    const int other = standing.of_triangle[j];
    REQUIRE(other >= 0);
    CHECK(standing.of_triangle[other] == other);
  }

  const test::Affine motion = test::rotation_about(1.1, {1, 2, 3}, {0, 0, 0}, {3, 2, 1});
  const Positions moved = test::transformed(motion, pair.base);
  const Positions rest = divergence_by_pass(pair.surface, pair.base, pair.base, true);
  const Positions turned = divergence_by_pass(pair.surface, pair.base, moved, true);
  CHECK((turned - rest * motion.leftCols<3>().transpose()).norm() < 1e-9 * rest.norm());
}

TEST_CASE("a part without any area keeps S_j = I: nothing stands in for it") {
  const Mesh part = test::sphere(1);
  Mesh both = test::appended(part, part);
  both.positions.bottomRows(part.vertex_count()).setConstant(4);
  const StandIns standing = stand_ins(both.positions, both.triangles, 1);
  CHECK(with_another(standing) == part.triangle_count());
  for (int j = 0; j < both.triangle_count(); ++j)
    CHECK(standing.of_triangle[j] == (j < part.triangle_count() ? j : -1));
}

TEST_CASE("a collapsed part turns with the part that it shares a vertex with") {
  const Mesh part = test::sphere(1);
  Mesh both = test::appended(part, part);
  both.positions.bottomRows(part.vertex_count()).rowwise() = Eigen::RowVector3d(1, 0, 0);
  const int first = part.vertex_count();
  for (Index k = 0; k < both.triangles.size(); ++k)
    if (both.triangles.data()[k] == first) both.triangles.data()[k] = 0;  // (1, 0, 0) in both
  for (int source : stand_ins(both.positions, both.triangles, 1).of_triangle)
    CHECK((source >= 0 && source < part.triangle_count()));
}

TEST_CASE("a base that collapses to a plane, a line or a point gives finite gradients") {
  const Pair pair;
  const auto& t = pair.surface.triangles;
  const SparseMatrix div =
      divergence(gradient(pair.surface.positions, t), triangle_metric(pair.surface.positions, t));
  for (int kept : {0, 1, 2}) {
    Positions flat = pair.deformed;
    flat.rightCols(3 - kept).setZero();
    for (bool rotation_only : {false, true}) {
      Eigen::MatrixXd gradients(3 * t.rows(), 3);
      for (Index j = 0; j < t.rows(); ++j) {
        // A triangle without area has no normal: what (15) adds along it is zero. On a line S_j has
        // one singular value, in place of which the part without stretch has 1; in a point none.
        Eigen::Matrix3d S = test::deformation_gradient(pair.base, flat, t, j);
        if (rotation_only && kept == 2) S = test::polar_rotation(S);
        if (rotation_only && kept == 1) S.normalize();
        gradients.middleRows<3>(3 * j) = S.transpose();
      }
      const Eigen::MatrixXd expected = div * gradients;
      const Positions result = divergence_by_pass(pair.surface, pair.base, flat, rotation_only);
      CHECK((result - expected).norm() <= 1e-12 * expected.norm());
    }
  }
}
