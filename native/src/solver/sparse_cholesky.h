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

/// Thrown for a matrix that is not positive definite to working precision.
class SingularMatrix : public Error {
 public:
  explicit SingularMatrix(int row);
  /// Where the factorization broke down, as a row of the matrix.
  int row() const { return row_; }

 private:
  int row_;
};

/// Precision in which a factor is stored. It is always computed in double.
enum class Precision { single, full };

/// Number of columns of a solve. Rows always have four values; in single precision a solve for
/// three is faster.
enum class Columns { three, four };

/// Iterates over a matrix four columns at a time; the rows of the current ones, filled up with
/// zeros, are a right-hand side for SparseCholesky::solve_rows().
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
  /// Fraction of the matrix's diagonal entry up to which a pivot is refused as cancelled: the
  /// matrix is singular to rounding. Tuned: in a singular Laplacian of 65,000 rows rounding leaves
  /// up to 1e-13.
  double smallest_pivot = 1e-12;
  Precision precision = Precision::full;
  ThreadPool* pool = nullptr;    ///< null: the caller's thread only
  Progress progress = {};        ///< called from any thread, never concurrently
  Stage stage = Stage::poisson;  ///< passed to progress
};

/// The supernodal factor of a symmetric positive definite matrix, A = C Cᵀ: for each supernode the
/// inverse of its diagonal block, C_ss⁻¹, and the rows below it, dense. A solve reads each block
/// twice, in storage order, and multiplies it by up to four columns at once. It is bound by reading
/// the factor from memory, which single precision halves.
///
/// Factored by the multifrontal method (Duff, Reid 1983; Liu 1992). Domains of the tree run in
/// parallel, in the factorization and in each solve.
class SparseCholesky {
 public:
  /// A: both triangles stored, with the pattern of the symbolic factorization. Throws
  /// SingularMatrix; Error(cancelled).
  SparseCholesky(const SparseMatrix& A, std::shared_ptr<const SymbolicCholesky> symbolic,
                 const FactorOptions& options = {});
  /// Ordered by minimum degree (AMD).
  explicit SparseCholesky(const SparseMatrix& A, const FactorOptions& options = {});

  const SymbolicCholesky& symbolic() const { return *symbolic_; }
  std::shared_ptr<const SymbolicCholesky> shared_symbolic() const { return symbolic_; }
  int size() const { return symbolic_->size(); }
  /// order()[k] is the row of A that is row k of the factor.
  const std::vector<int>& order() const { return symbolic_->order; }
  /// A matrix of A's size with its rows and columns in the factor's order.
  SparseMatrix in_order(const SparseMatrix& matrix) const;
  Precision precision() const { return precision_; }
  /// A copy rounded to single precision. This one must be in full precision.
  SparseCholesky in_single(ThreadPool* pool) const;

  /// Scratch of a solve, slotted_size()×4, to be reused by later ones: allocating the pages of a
  /// large one takes longer than the solve.
  struct SolveScratch {
    RawArray<float> single;
    RawArray<double> full;
    Rows right;  // used by solve_rows() only
  };

  /// Solves A X = B for three or four columns, rows in the factor's order. Sections are the
  /// domains and the top. right: slotted_size()×4, row-major; the value of a row of the top is the
  /// sum of the row and its slots. fill(section) is called before its rows and slots are read: a
  /// frame computes its right-hand side there, while it is in the caches. done(begin, end, x)
  /// receives the rows begin to end − 1 of X, float or double as precision() says. Both are called
  /// once for each section, from any thread.
  template <class Fill, class Done>
  void solve_in_order(const double* right, SolveScratch& scratch, ThreadPool* pool,
                      const Fill& fill, const Done& done, Columns columns = Columns::three) const {
    const auto solve = [&](auto& x) {
      const auto eliminate = [&](int section) {
        fill(section);
        forward(section, right, x, columns);
      };
      solve_after(eliminate, x, pool, done, columns);
    };
    if (precision_ == Precision::single)
      solve(scratch.single);
    else
      solve(scratch.full);
  }

  /// Solves A X = B for three or four columns, rows in A's own order. right(r) returns row r of B,
  /// four values; take(r, x) receives row r of X, float or double as precision() says. Both are
  /// called once for each row, from any thread.
  template <class Right, class Take>
  void solve_rows(const Right& right, const Take& take, SolveScratch& scratch, ThreadPool* pool,
                  Columns columns = Columns::four) const {
    const Index slotted = symbolic_->slotted_size();
    if (scratch.right.rows() != slotted) scratch.right = Rows::Zero(slotted, 4);
    solve_in_order(
        scratch.right.data(), scratch, pool,
        [&](int section) {
          const int end = symbolic_->section_begin(section + 1);
          for (int k = symbolic_->section_begin(section); k < end; ++k)
            scratch.right.row(k) = right(order()[size_t(k)]);
        },
        [&](int begin, int end, const auto* x) {
          for (int k = begin; k < end; ++k, x += 4) take(order()[size_t(k)], x);
        },
        columns);
  }

  /// Backward substitution alone, Cᵀ X = Y. fill(section, y) writes its rows of Y into y, which
  /// holds all size()×4, row-major, float or double as precision() says. done as above.
  template <class Fill, class Done>
  void backward_solve(SolveScratch& scratch, ThreadPool* pool, const Fill& fill, const Done& done,
                      Columns columns = Columns::three) const {
    const auto solve = [&](auto& x) {
      solve_after([&](int section) { fill(section, x.data()); }, x, pool, done, columns);
    };
    if (precision_ == Precision::single)
      solve(scratch.single);
    else
      solve(scratch.full);
  }

  /// A step of forward substitution, at one supernode, in full precision. x and right:
  /// slotted_size()×4; x must be zero except for the results of earlier steps.
  void eliminate(int supernode, const double* right, double* x) const;

  /// Solves A X = B, rows in A's own order, any number of columns.
  RowMatrix solve(const RowMatrix& B, ThreadPool* pool = nullptr) const;

  /// Number of stored entries, explicit zeros included.
  int64_t entries() const { return value_begin_.empty() ? 0 : value_begin_.back(); }
  double bytes() const;

 private:
  /// Allocates the values, uninitialized.
  SparseCholesky(std::shared_ptr<const SymbolicCholesky> symbolic, Precision precision);
  template <class Real>
  FactorView<Real> view() const;
  void factor(const SparseMatrix& A, const FactorOptions& options);
  template <class Real>
  void prepare(RawArray<Real>& x) const;
  template <class Real>
  void forward(int section, const double* right, RawArray<Real>& x, Columns columns) const;
  template <class Real>
  void backward(int section, RawArray<Real>& x, Columns columns) const;

  /// Backward substitution after eliminate_section(section), which leaves C⁻¹ B in its rows.
  template <class Real, class Eliminate, class Done>
  void solve_after(const Eliminate& eliminate_section, RawArray<Real>& x, ThreadPool* pool,
                   const Done& done, Columns columns) const {
    const SymbolicCholesky& plan = *symbolic_;
    const int domains = plan.domain_count();
    prepare(x);
    const auto finish = [&](int section) {
      backward(section, x, columns);
      const int begin = plan.section_begin(section);
      done(begin, plan.section_begin(section + 1), x.data() + 4 * static_cast<size_t>(begin));
    };
    run_tasks(pool, domains, eliminate_section);
    eliminate_section(domains);
    finish(domains);
    run_tasks(pool, domains, finish);
  }

  std::shared_ptr<const SymbolicCholesky> symbolic_;
  Precision precision_ = Precision::full;
  // Start of each supernode's values: C_ss⁻¹, then the rows below, in groups: see rows_together().
  std::vector<int64_t> value_begin_;
  RawArray<double> full_;
  RawArray<float> single_;
};

}  // namespace dd
