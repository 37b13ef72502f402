// SPDX-License-Identifier: GPL-3.0-or-later
#include "sparse_cholesky.h"

#include <Eigen/Dense>
#include <numeric>

#include "catch.h"
#include "meshes.h"
#include "operators.h"

using namespace dd;

namespace {

SparseMatrix shifted_laplacian(const Mesh& mesh, double shift) {
  SparseMatrix A = cotangent_laplacian(triangle_metric(mesh.positions, mesh.triangles),
                                       mesh.triangles, mesh.vertex_count());
  for (Index k = 0; k < A.rows(); ++k) A.coeffRef(k, k) += shift;
  return A;
}

}  // namespace

TEST_CASE("solutions equal a dense solve, for any number of columns") {
  const SparseMatrix A = shifted_laplacian(test::rough_sphere(3, 0.2), 0.1);
  const SparseCholesky factor(A);
  const Eigen::LDLT<Eigen::MatrixXd> dense{Eigen::MatrixXd(A)};
  std::srand(1);
  for (int columns : {1, 3, 4, 5, 11}) {
    const RowMatrix B = RowMatrix::Random(A.rows(), columns);
    const RowMatrix expected = dense.solve(B);
    CHECK((factor.solve(B) - expected).norm() < 1e-11 * expected.norm());
  }
}

TEST_CASE("the order is a permutation, and the panel solve uses it") {
  const SparseMatrix A = shifted_laplacian(test::bumpy_plane(14, 3), 0.05);
  const SparseCholesky factor(A);
  std::vector<int> sorted = factor.order(), counting(sorted.size());
  std::sort(sorted.begin(), sorted.end());
  std::iota(counting.begin(), counting.end(), 0);
  REQUIRE(sorted == counting);

  const RowMatrix X = RowMatrix::Random(A.rows(), 4), B = A * X;
  Rows right = Rows::Zero(factor.elimination().slotted_size(), 4);
  for (Index k = 0; k < A.rows(); ++k) right.row(k) = B.row(factor.order()[k]);
  SparseCholesky::Space space;
  double worst = 1e9;
  factor.solve_in_order(
      right.data(), space, nullptr, [](int) {},
      [&](int begin, int end, const auto* x) {
        worst = 0;
        for (int k = begin; k < end; ++k)
          for (int c = 0; c < 4; ++c)
            worst = std::max(worst, std::abs(*x++ - X(factor.order()[k], c)));
      });
  CHECK(worst < 1e-10);
}

TEST_CASE("a singular or indefinite matrix is refused with a row") {
  const Mesh mesh = test::sphere(2);
  const auto refused_row = [](const SparseMatrix& A) {
    try {
      SparseCholesky factor(A);
    } catch (const SingularMatrix& singular) {
      CHECK(singular.status() == Status::numeric);
      return singular.row();
    }
    return -1;
  };
  const int row = refused_row(shifted_laplacian(mesh, 0));
  CHECK((row >= 0 && row < mesh.vertex_count()));
  CHECK(refused_row(shifted_laplacian(mesh, -0.5)) >= 0);
  SparseMatrix hole = shifted_laplacian(mesh, 0.1);
  for (Index k = 0; k < hole.rows(); ++k) {
    hole.coeffRef(5, k) = 0;
    hole.coeffRef(k, 5) = 0;
  }
  CHECK(refused_row(hole) == 5);
}
