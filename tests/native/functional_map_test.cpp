// SPDX-License-Identifier: GPL-3.0-or-later
#include "match/functional_map.h"

#include <cmath>

#include "catch.h"
#include "match/spectral_basis.h"
#include "meshes.h"

using namespace dd;

TEST_CASE("the smoothest functions of a sphere are the spherical harmonics") {
  const Mesh ball = test::sphere(4);
  std::vector<int> seeds;
  for (int v = 0; v < 40; ++v) seeds.push_back(v * 25);
  const SpectralBasis basis = spectral_basis(ball, 16, seeds, nullptr);
  // Eigenvalues of the sphere of area 1: 4π l (l + 1), 2 l + 1 times each.
  int k = 0;
  for (int degree = 0; degree < 4; ++degree)
    for (int order = 0; order < 2 * degree + 1; ++order, ++k)
      CHECK(basis.values[k] ==
            Approx(4 * std::acos(-1.0) * degree * (degree + 1)).epsilon(0.02).margin(1e-8));
  // The functions of degree 1 span the coordinates.
  const Eigen::MatrixXd linear = basis.functions.middleCols(1, 3);
  for (int c = 0; c < 3; ++c) {
    const Eigen::VectorXd coordinate = ball.positions.col(c);
    const Eigen::VectorXd share = linear.colPivHouseholderQr().solve(coordinate);
    CHECK((linear * share - coordinate).norm() < 0.01 * coordinate.norm());
  }
}

TEST_CASE("nearest rows are those of a search through all") {
  const RowMatrix first = RowMatrix::Random(150, 7), second = RowMatrix::Random(90, 7);
  const NearestRows found = nearest_rows(first, second);
  for (Index i = 0; i < first.rows(); ++i) {
    Index best = 0;
    (second.rowwise() - first.row(i)).rowwise().norm().minCoeff(&best);
    CHECK(found.of_first[size_t(i)] == best);
  }
  for (Index j = 0; j < second.rows(); ++j) {
    Index best = 0;
    (first.rowwise() - second.row(j)).rowwise().norm().minCoeff(&best);
    CHECK(found.of_second[size_t(j)] == best);
  }
}
