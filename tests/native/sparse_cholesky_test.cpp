// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/sparse_cholesky.h"

#include <Eigen/Dense>
#include <Eigen/SparseCholesky>
#include <atomic>
#include <numeric>

#include "catch.h"
#include "meshes.h"
#include "solver/sparse_forward.h"
#include "systems/free_block.h"
#include "systems/operators.h"

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
  Rows right = Rows::Zero(factor.symbolic().slotted_size(), 4);
  for (Index k = 0; k < A.rows(); ++k) right.row(k) = B.row(factor.order()[k]);
  SparseCholesky::SolveScratch space;
  RowMatrix found = RowMatrix::Zero(A.rows(), 4);
  factor.solve_in_order(
      right.data(), space, nullptr, [](int) {},
      [&](int begin, int end, const auto* x) {
        for (int k = begin; k < end; ++k)
          for (int c = 0; c < 4; ++c) found(factor.order()[k], c) = *x++;
      });
  CHECK((found - X).norm() < 1e-10);
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
  // A closed surface's Laplacian is singular: its last pivot is rounding, in any size and order.
  for (int level : {4, 5, 6})
    for (double noise : {0.0, 0.05, 0.3}) {
      const Mesh closed = test::rough_sphere(level, noise);
      CHECK(refused_row(shifted_laplacian(closed, 0)) >= 0);
    }
}

namespace {

/// The free block of a plane's Laplacian, as frames solve with it.
struct System {
  Mesh mesh = test::bumpy_plane(121);
  Region region = make_region(mesh, test::strip_roles(121, 121, 10, 110), 1);
  SparseMatrix A = free_block(surface_operators(mesh.positions, mesh.triangles).laplacian, region);
  RowMatrix B = RowMatrix::Random(A.rows(), 4);
  SparseCholesky factor(Precision precision, ThreadPool* pool, bool by_places = true) const {
    BlockOptions options;
    const Dissection dissection = free_dissection(A, region, mesh.positions, pool);
    if (by_places) options.dissection = &dissection;
    options.precision = precision;
    options.pool = pool;
    return factor_free_block(A, region, options);
  }
};

}  // namespace

TEST_CASE("a factor in domains equals Eigen's simplicial one, by either order") {
  const System system;
  const RowMatrix expected =
      Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>>(system.A).solve(system.B);
  for (bool by_places : {true, false}) {
    const SparseCholesky factor = system.factor(Precision::full, nullptr, by_places);
    REQUIRE(factor.symbolic().domain_count() > 1);
    REQUIRE(!factor.symbolic().top_index_of_slot.empty());
    CHECK((factor.solve(system.B) - expected).norm() < 1e-11 * expected.norm());
    const SparseCholesky single = factor_free_block(system.A, system.region, [&] {
      BlockOptions options;
      options.precision = Precision::single;
      options.symbolic = factor.shared_symbolic();
      return options;
    }());
    const double error = (single.solve(system.B) - expected).norm() / expected.norm();
    CHECK(error < 1e-5);
    CHECK(error > 1e-9);  // it was stored in single precision
    CHECK(single.bytes() < 0.6 * factor.bytes());
    // Rounding a factor gives the one that was stored in single precision at once.
    ThreadPool pool(2);
    const SparseCholesky rounded = factor.in_single(&pool);
    CHECK(rounded.solve(system.B) == single.solve(system.B));
    CHECK(rounded.bytes() == single.bytes());
  }
}

TEST_CASE("the first half of a solve can be precomputed for columns of a few entries") {
  const System system;
  const SparseCholesky factor = system.factor(Precision::full, nullptr);
  const SymbolicCholesky& symbolic = factor.symbolic();
  REQUIRE(symbolic.domain_count() > 1);
  // Entries in domains and at the top, several in a column, and an empty column.
  std::vector<Eigen::Triplet<double>> entries;
  const int n = factor.size(), top = symbolic.section_begin(symbolic.domain_count());
  const int rows[] = {0, 7, top - 1, top, n - 1, n / 2, n / 3};
  for (int k = 0; k < 7; ++k) {
    entries.emplace_back(rows[k], k, 1 + k);
    entries.emplace_back(rows[(3 * k) % 7], k, 0.5);
    entries.emplace_back((rows[k] + 40) % n, k, -2);
  }
  SparseMatrix B(n, 8);
  B.setFromTriplets(entries.begin(), entries.end());
  Rows coefficients(8, 4);
  for (Index i = 0; i < coefficients.size(); ++i)
    coefficients.data()[i] = std::sin(3.0 * double(i));

  const SparseForward forward(factor, B, factor.entries());
  REQUIRE(!forward.empty());
  CHECK(forward.bytes() < 0.1 * factor.bytes());
  const auto solution = [&](const SparseCholesky& by) {
    SparseCholesky::SolveScratch space;
    RowMatrix found(n, 4);
    by.backward_solve(
        space, nullptr, [&](int part, auto* y) { forward.multiply(part, coefficients, y); },
        [&](int begin, int end, const auto* x) {
          for (int k = begin; k < end; ++k, x += 4)
            for (int c = 0; c < 4; ++c) found(by.order()[size_t(k)], c) = x[c];
        },
        Columns::four);
    return found;
  };
  RowMatrix right(n, 4);
  const RowMatrix product = B * coefficients;
  for (int k = 0; k < n; ++k) right.row(factor.order()[size_t(k)]) = product.row(k);
  const RowMatrix expected =
      Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>>(system.A).solve(right);
  CHECK((solution(factor) - expected).norm() < 1e-11 * expected.norm());
  CHECK((solution(factor.in_single(nullptr)) - expected).norm() < 1e-5 * expected.norm());
  CHECK(SparseForward(factor, B, 100).empty());
}

TEST_CASE("an order and a solve are the same to the bit by any number of threads", "[threads]") {
  const System system;
  const auto order = [&](ThreadPool* pool) {
    return free_dissection(system.A, system.region, system.mesh.positions, pool).order(system.A);
  };
  const std::vector<int> order_alone = order(nullptr);
  for (int count : {2, 8}) {
    ThreadPool pool(count);
    for (int round = 0; round < 5; ++round) REQUIRE(order(&pool) == order_alone);
  }
  for (Precision precision : {Precision::single, Precision::full}) {
    const RowMatrix alone = system.factor(precision, nullptr).solve(system.B);
    for (int count : {2, 3, 8}) {
      ThreadPool pool(count);
      for (int round = 0; round < 5; ++round)
        REQUIRE(system.factor(precision, &pool).solve(system.B, &pool) == alone);
    }
  }
}

TEST_CASE(
    "nested dissection fills no more than minimum degree, and the top separates the domains") {
  const System system;
  const SparseCholesky by_places = system.factor(Precision::single, nullptr);
  const SparseCholesky by_degree = system.factor(Precision::single, nullptr, false);
  CHECK(10 * by_places.entries() < 11 * by_degree.entries());
  // Triangles of 1 : 1,000 must not mislead the planes of the dissection.
  const Mesh strip = test::grid(2001, 3, [](double x, double) { return 0.01 * std::sin(60 * x); });
  const Region of_strip = make_region(strip, test::strip_roles(2001, 3, 1, 2000), 1);
  const SparseMatrix thin =
      free_block(surface_operators(strip.positions, strip.triangles).laplacian, of_strip);
  const Dissection cuts = free_dissection(thin, of_strip, strip.positions);
  BlockOptions by_cuts;
  by_cuts.dissection = &cuts;
  CHECK(factor_free_block(thin, of_strip, by_cuts).entries() < 40 * thin.rows());

  const SymbolicCholesky& e = by_places.symbolic();
  const auto part_of = [&](int place) {
    int part = 0;
    while (place >= e.section_begin(part + 1)) ++part;
    return part;
  };
  int across = 0;
  for (int k = 0; k < e.size(); ++k)
    for (SparseMatrix::InnerIterator it(system.A, e.order[k]); it; ++it) {
      const int a = part_of(k), b = part_of(e.index_of[it.row()]);
      across += a != b && a < e.domain_count() && b < e.domain_count();
    }
  CHECK(across == 0);
}

TEST_CASE("a factorization can be cancelled, and says how far it is") {
  const System system;
  BlockOptions options;
  std::vector<double> told;
  options.progress = [&](double fraction, Stage) {
    told.push_back(fraction);
    return true;
  };
  factor_free_block(system.A, system.region, options);
  CHECK(told.size() > 5);
  CHECK(std::is_sorted(told.begin(), told.end()));
  CHECK(told.back() <= 1);
  options.progress = [](double fraction, Stage) { return fraction < 0.3; };
  CHECK_THROWS_AS(factor_free_block(system.A, system.region, options), Error);
}

TEST_CASE("a pool does every task once, passes on exceptions, and can go on after one") {
  ThreadPool pool(4);
  CHECK(pool.count() == 4);
  for (int tasks : {0, 1, 2, 7, 1000}) {
    std::vector<std::atomic<int>> done(static_cast<size_t>(tasks));
    pool.run(tasks, [&](int i) { ++done[i]; });
    CHECK(std::all_of(done.begin(), done.end(), [](const auto& times) { return times == 1; }));
  }
  CHECK_THROWS_AS(pool.run(50,
                           [](int i) {
                             if (i == 17) throw Error(Status::numeric, "no");
                           }),
                  Error);
  std::atomic<int64_t> sum{0};
  pool.parallel_for(100000, 10, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) sum += i;
  });
  CHECK(sum == 99999LL * 100000 / 2);
}
