// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <memory>
#include <vector>

#include "kernels/kernels.h"
#include "solver/symbolic_cholesky.h"
#include "support/error.h"
#include "support/progress.h"
#include "support/raw_array.h"
#include "support/thread_pool.h"
#include "support/types.h"

namespace dd {

/// A matrix that is not positive definite to working precision.
class SingularMatrix : public Error {
 public:
  explicit SingularMatrix(int row);
  /// Where the factorization broke down, as a row of the matrix.
  int row() const { return row_; }

 private:
  int row_;
};

/// How the factor is kept. It is computed in double always.
enum class Precision { single, full };

/// How many columns a solve is for. Rows have room for four; in single precision three take less
/// time.
enum class Columns { three, four };

/// A matrix four columns at a time, as rows for SparseCholesky::solve_rows().
class FourColumns {
 public:
  explicit FourColumns(const RowMatrix& matrix) : matrix_(matrix) {}
  bool next() { return (first_ += 4) < matrix_.cols(); }
  Index first() const { return first_; }
  Index width() const { return std::min<Index>(4, matrix_.cols() - first_); }
  Eigen::RowVector4d operator()(Index row) const {
    Eigen::RowVector4d result = Eigen::RowVector4d::Zero();
    for (Index c = 0; c < width(); ++c) result[c] = matrix_(row, first_ + c);
    return result;
  }

 private:
  const RowMatrix& matrix_;
  Index first_ = -4;
};

struct FactorOptions {
  /// A pivot of less than this times its diagonal entry is refused: that far it cancelled. Rounding
  /// leaves up to 1e-13 of it in a singular Laplacian of 65,000 rows.
  double smallest_pivot = 1e-12;
  Precision precision = Precision::full;
  ThreadPool* pool = nullptr;    ///< null: the caller's thread alone
  Progress progress = {};        ///< asked now and then, from any thread but one at a time
  Stage stage = Stage::poisson;  ///< what it is told
};

/// The factor of a symmetric positive definite matrix, A = C Cᵀ, in supernodes: for each the
/// inverse of its diagonal block, C_ss⁻¹, and the rows below it, dense. A solve reads each block
/// twice, in order, and gives all its time to products of small dense matrices with up to four
/// columns at once; what bounds it is how fast the factor comes from memory, which single precision
/// halves.
///
/// Factored by fronts (multifrontal: Duff, Reid 1983; Liu 1992). Domains of the tree run in
/// parallel, in the factorization and in each solve.
class SparseCholesky {
 public:
  /// A: both triangles stored, with the pattern that the symbolic factorization was made of.
  /// Throws SingularMatrix; Error(cancelled).
  SparseCholesky(const SparseMatrix& A, std::shared_ptr<const SymbolicCholesky> symbolic,
                 const FactorOptions& options = {});
  /// Ordered by minimum degree (AMD).
  explicit SparseCholesky(const SparseMatrix& A, const FactorOptions& options = {});

  const SymbolicCholesky& symbolic() const { return *symbolic_; }
  std::shared_ptr<const SymbolicCholesky> shared_symbolic() const { return symbolic_; }
  int size() const { return symbolic_->size(); }
  /// order()[k] is the row of A that stands at place k of the factor.
  const std::vector<int>& order() const { return symbolic_->order; }
  /// A matrix of A's size with its rows and columns in the factor's order.
  SparseMatrix in_order(const SparseMatrix& matrix) const;
  Precision precision() const { return precision_; }
  /// The same, rounded. This one must be in full precision.
  SparseCholesky in_single(ThreadPool* pool) const;

  /// Work space of a solve, slotted_size()×4, to be kept between solves: a large one's pages take
  /// longer to get than to solve.
  struct Space {
    RawArray<float> single;
    RawArray<double> full;
    Rows right;  // of solve_rows() alone
  };

  /// Solves A X = B for three or four columns, rows in the factor's order.
  /// right: slotted_size()×4, row-major; what belongs to a row of the top may be spread over its
  /// slots. fill(part) is called before the rows and slots of a part are read: a frame makes its
  /// right-hand side there, where the caches have it. done(begin, end, x) gives the rows of x at
  /// these places, float or double as precision() says. Each part once, from any thread.
  template <class Fill, class Done>
  void solve_in_order(const double* right, Space& space, ThreadPool* pool, const Fill& fill,
                      const Done& done, Columns columns = Columns::three) const {
    const auto solve = [&](auto& x) {
      const auto eliminate = [&](int part) {
        fill(part);
        forward(part, right, x, columns);
      };
      solve_after(eliminate, x, pool, done, columns);
    };
    if (precision_ == Precision::single)
      solve(space.single);
    else
      solve(space.full);
  }

  /// Solves A X = B for three or four columns, rows in A's own order. right(r) is row r of B, of
  /// four columns; take(r, x) is given row r of X, float or double as precision() says. Each row
  /// once, from any thread.
  template <class Right, class Take>
  void solve_rows(const Right& right, const Take& take, Space& space, ThreadPool* pool,
                  Columns columns = Columns::four) const {
    const Index slotted = symbolic_->slotted_size();
    if (space.right.rows() != slotted) space.right = Rows::Zero(slotted, 4);
    solve_in_order(
        space.right.data(), space, pool,
        [&](int part) {
          const int end = symbolic_->section_begin(part + 1);
          for (int k = symbolic_->section_begin(part); k < end; ++k)
            space.right.row(k) = right(order()[size_t(k)]);
        },
        [&](int begin, int end, const auto* x) {
          for (int k = begin; k < end; ++k, x += 4) take(order()[size_t(k)], x);
        },
        columns);
  }

  /// The second half alone, Cᵀ X = Y. fill(part, y) writes the rows of Y that belong to a part; y
  /// is where all of them are, size()×4, row-major, float or double as precision() says. done as
  /// above.
  template <class Fill, class Done>
  void solve_second_half(Space& space, ThreadPool* pool, const Fill& fill, const Done& done,
                         Columns columns = Columns::three) const {
    const auto solve = [&](auto& x) {
      solve_after([&](int part) { fill(part, x.data()); }, x, pool, done, columns);
    };
    if (precision_ == Precision::single)
      solve(space.single);
    else
      solve(space.full);
  }

  /// A step of the first half, in full precision: at one supernode, of rows that were zero but for
  /// what such steps left, x and right both slotted_size()×4.
  void eliminate(int supernode, const double* right, double* x) const;

  /// Solves A X = B, rows in A's own order, any number of columns.
  RowMatrix solve(const RowMatrix& B, ThreadPool* pool = nullptr) const;

  /// Entries that are stored, zeros in supernodes among them.
  int64_t entries() const { return value_begin_.empty() ? 0 : value_begin_.back(); }
  double bytes() const;

 private:
  /// Of no values yet.
  SparseCholesky(std::shared_ptr<const SymbolicCholesky> symbolic, Precision precision);
  template <class Real>
  FactorView<Real> view() const;
  void factor(const SparseMatrix& A, const FactorOptions& options);
  template <class Real>
  void prepare(RawArray<Real>& x) const;
  template <class Real>
  void forward(int part, const double* right, RawArray<Real>& x, Columns columns) const;
  template <class Real>
  void backward(int part, RawArray<Real>& x, Columns columns) const;

  /// first_half(part) leaves C⁻¹ B in the rows of that part.
  template <class Real, class FirstHalf, class Done>
  void solve_after(const FirstHalf& first_half, RawArray<Real>& x, ThreadPool* pool,
                   const Done& done, Columns columns) const {
    const SymbolicCholesky& e = *symbolic_;
    const int domains = e.domain_count();
    prepare(x);
    const auto finish = [&](int part) {
      backward(part, x, columns);
      const int begin = e.section_begin(part);
      done(begin, e.section_begin(part + 1), x.data() + 4 * static_cast<size_t>(begin));
    };
    run_tasks(pool, domains, first_half);
    first_half(domains);
    finish(domains);
    run_tasks(pool, domains, finish);
  }

  std::shared_ptr<const SymbolicCholesky> symbolic_;
  Precision precision_ = Precision::full;
  // Of each supernode C_ss⁻¹, then the rows below, in groups: see rows_together().
  std::vector<int64_t> value_begin_;
  RawArray<double> full_;
  RawArray<float> single_;
};

}  // namespace dd
