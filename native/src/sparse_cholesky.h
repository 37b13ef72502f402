// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "elimination.h"
#include "error.h"
#include "progress.h"
#include "streamed_array.h"
#include "types.h"
#include "workers.h"

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

struct FactorOptions {
  /// A pivot of less than this times its diagonal entry is refused: that far it cancelled. Rounding
  /// leaves up to 1e-13 of it in a singular Laplacian of 65,000 rows.
  double smallest_pivot = 1e-12;
  Precision precision = Precision::full;
  Workers* workers = nullptr;  ///< null: the caller's thread alone
  Progress progress = {};      ///< asked now and then, from any thread but one at a time
  const char* stage = "Factoring the Poisson system";  ///< what it is told
};

/// The factor of a symmetric positive definite matrix, A = C Cᵀ, in supernodes: for each the inverse
/// of its diagonal block, C_ss⁻¹, and the rows below it, dense. A solve reads each block twice, in
/// order, and gives all its time to products of small dense matrices with up to four columns at once;
/// what bounds it is how fast the factor comes from memory, which single precision halves.
///
/// Factored by fronts (multifrontal: Duff, Reid 1983; Liu 1992). Domains of the elimination run in
/// parallel, in the factorization and in each solve.
class SparseCholesky {
 public:
  /// A: both triangles stored, with the pattern that the elimination was made of.
  /// Throws SingularMatrix; Error(cancelled).
  SparseCholesky(const SparseMatrix& A, std::shared_ptr<const Elimination> elimination,
                 const FactorOptions& options = {});
  /// Ordered by minimum degree (AMD).
  explicit SparseCholesky(const SparseMatrix& A, const FactorOptions& options = {});

  const Elimination& elimination() const { return *elimination_; }
  std::shared_ptr<const Elimination> shared_elimination() const { return elimination_; }
  int size() const { return elimination_->size(); }
  /// order()[k] is the row of A that stands at place k of the factor.
  const std::vector<int>& order() const { return elimination_->order; }
  Precision precision() const { return precision_; }

  /// Work space of a solve, slotted_size()×4, to be kept between solves.
  struct Space {
    StreamedArray<float> single;
    StreamedArray<double> full;
  };

  /// Solves A X = B for four columns, in single precision three, whose rows stand in the factor's order. right: slotted_size()×4,
  /// row-major; what belongs to a row of the top may be spread over its slots. fill(d) is called
  /// before the rows and slots of domain d are read, and for the top with domain_count(): a frame
  /// makes its right-hand side there, where the caches have it. done(begin, end, x) is called with
  /// ranges of places and their rows of x, float or double as precision() says. Both come from any
  /// thread, once a domain.
  template <class Fill, class Done>
  void solve_in_order(const double* right, Space& space, Workers* workers, const Fill& fill,
                      const Done& done) const {
    if (precision_ == Precision::single)
      solve_as(right, space.single, workers, fill, done);
    else
      solve_as(right, space.full, workers, fill, done);
  }

  /// Solves A X = B, rows in A's own order, any number of columns.
  RowMatrix solve(const RowMatrix& B, Workers* workers = nullptr) const;

  /// Entries that are stored, zeros in supernodes among them.
  int64_t entries() const { return value_begin_.empty() ? 0 : value_begin_.back(); }
  double bytes() const;

 private:
  template <class Real>
  const Real* values() const;
  void factor(const SparseMatrix& A, const FactorOptions& options);
  template <class Real>
  void prepare(StreamedArray<Real>& x) const;
  template <class Real>
  void forward(int domain, const double* right, StreamedArray<Real>& x) const;
  template <class Real>
  void backward(int domain, StreamedArray<Real>& x) const;

  template <class Real, class Fill, class Done>
  void solve_as(const double* right, StreamedArray<Real>& x, Workers* workers, const Fill& fill,
                const Done& done) const {
    const Elimination& e = *elimination_;
    const int domains = e.domain_count();
    prepare(x);
    const auto each_domain = [&](const auto& task) {
      if (workers)
        workers->run(domains, task);
      else
        for (int d = 0; d < domains; ++d) task(d);
    };
    each_domain([&](int d) {
      fill(d);
      forward(d, right, x);
    });
    fill(domains);
    forward(domains, right, x);
    backward(domains, x);
    const int top = e.begin[e.domain_begin[domains]];
    done(top, size(), x.data() + 4 * static_cast<size_t>(top));
    each_domain([&](int d) {
      backward(d, x);
      const int begin = e.begin[e.domain_begin[d]];
      done(begin, e.begin[e.domain_begin[d + 1]], x.data() + 4 * static_cast<size_t>(begin));
    });
  }

  std::shared_ptr<const Elimination> elimination_;
  Precision precision_ = Precision::full;
  // Of each supernode, one row after the other: C_ss⁻¹ as a packed triangle, then
  // the rows below.
  std::vector<int64_t> value_begin_;
  StreamedArray<double> full_;
  StreamedArray<float> single_;
};

}  // namespace dd
