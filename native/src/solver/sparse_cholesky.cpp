// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/sparse_cholesky.h"

#include <algorithm>
#include <array>
#include <mutex>
#include <string>
#include <utility>

#include "kernels/dense_kernels.h"
#include "solver/fill_reducing_order.h"

namespace dd {

SingularMatrix::SingularMatrix(int row)
    : Error(Status::numeric, "The system has no unique solution at row " + std::to_string(row)),
      row_(row) {}

SparseCholesky::SparseCholesky(const SparseMatrix& A, const FactorOptions& options)
    : SparseCholesky(A, std::make_shared<SymbolicCholesky>(A, minimum_degree(A)), options) {}

SparseCholesky::SparseCholesky(const SparseMatrix& A,
                               std::shared_ptr<const SymbolicCholesky> symbolic,
                               const FactorOptions& options)
    : SparseCholesky(std::move(symbolic), options.precision) {
  factor(A, options);
}

SparseCholesky::SparseCholesky(std::shared_ptr<const SymbolicCholesky> symbolic,
                               Precision precision)
    : symbolic_(std::move(symbolic)), precision_(precision) {
  const SymbolicCholesky& plan = *symbolic_;
  value_begin_.push_back(0);
  for (int s = 0; s < plan.supernode_count(); ++s) {
    const int width = plan.width(s);
    const int64_t triangle = precision_ == Precision::single ? packed_triangle_size<float>(width)
                                                             : packed_triangle_size<double>(width);
    value_begin_.push_back(value_begin_.back() + triangle + int64_t{width} * plan.height(s));
  }
  if (precision_ == Precision::single)
    single_ = RawArray<float>(static_cast<size_t>(entries()));
  else
    full_ = RawArray<double>(static_cast<size_t>(entries()));
}

namespace {

/// Visits the entries of a supernode in the storage order of a factor of Reals, see
/// rows_together(): calls inverse(i, j) for those of C_ss⁻¹, then below(i, j) for those of the rows
/// below.
template <class Real, class Inverse, class Below>
void for_each_entry(int width, int height, const Inverse& inverse, const Below& below) {
  const auto group = [](int first, int rows, int length, const auto& entry) {
    for (int j = 0; j < length; ++j)
      for (int i = first; i < first + rows; ++i) entry(i, j);
  };
  for (int left = width, rows = 0; left > 0; left -= rows) {
    rows = rows_together(left, kTriangleRows<Real>);
    group(left - rows, rows, left, inverse);
  }
  for (int i = 0, rows = 0; i < height; i += rows) {
    rows = rows_together(height - i, kRowsBelow<Real>);
    group(i, rows, width, below);
  }
}

constexpr int kChunk = 96;  // rows or columns of a front that are a task

/// A pool of memory for update matrices, reused by later fronts: in a large factorization fresh
/// allocations would spend a fifth of the time on pages that the system clears.
class Buffers {
 public:
  RawArray<double> take(size_t size) {
    const size_t size_class = class_of(size);
    const std::lock_guard<std::mutex> lock(mutex_);
    std::vector<RawArray<double>>& free = free_[size_class];
    if (free.empty()) return RawArray<double>(size_t{1} << size_class);
    RawArray<double> buffer = std::move(free.back());
    free.pop_back();
    return buffer;
  }
  void give_back(RawArray<double> buffer) {
    const size_t size_class = class_of(buffer.size());
    const std::lock_guard<std::mutex> lock(mutex_);
    free_[size_class].push_back(std::move(buffer));
  }

 private:
  /// The binary logarithm, rounded up.
  static size_t class_of(size_t size) {
    size_t result = 0;
    while ((size_t{1} << result) < size) ++result;
    return result;
  }
  std::mutex mutex_;
  std::array<std::vector<RawArray<double>>, 64> free_;
};

/// The frontal matrices of a factorization, whose updates are passed from children to parents.
class Fronts {
 public:
  Fronts(const SparseMatrix& A, const SymbolicCholesky& plan, double smallest_pivot)
      : A_(A),
        plan_(plan),
        smallest_pivot_(smallest_pivot),
        updates_(static_cast<size_t>(plan.supernode_count())),
        children_(updates_.size()) {
    for (int s = 0; s < plan.supernode_count(); ++s)
      if (plan.parent[s] >= 0) children_[plan.parent[s]].push_back(s);
  }

  /// Consecutive rows of a front, from first on, that are consecutive in its parent's front, too:
  /// row i is row i + at there.
  struct Run {
    int first, at;
  };

  /// A frontal matrix: the pivot columns, `size` rows each, and the update matrix, height×height.
  struct Front {
    double* panel;
    double* update;
    int width, height, size;
  };

  /// Scratch of one thread, for supernodes first to last − 1.
  struct Scratch {
    Scratch(const SymbolicCholesky& plan, int first, int last) : front_row(size_t(plan.size())) {
      size_t most = 0, widest = 0;
      for (int s = first; s < last; ++s) {
        const size_t width = size_t(plan.width(s)), height = size_t(plan.height(s));
        most = std::max(most, width * (width + 2 * height));
        widest = std::max(widest, width);
      }
      panel = RawArray<double>(most + 2 * kReadBeyond);
      inverse = RawArray<double>(widest * widest + kReadBeyond);
      bounds.resize(widest);
    }
    RawArray<double> panel, inverse;
    std::vector<double> bounds;
    RawArray<int> front_row;  // row in the front, by index of the factor
    std::vector<Run> runs;
  };

  /// Factors supernode s: C_ss⁻¹ into scratch.inverse, the rows below it into Y, height×width in
  /// scratch.panel, which is returned, and keeps the update matrix for the parent.
  const double* eliminate(int s, Scratch& scratch, ThreadPool* pool) {
    const int width = plan_.width(s), height = plan_.height(s), size = width + height;
    const int first = plan_.begin[s];
    const int* rows = plan_.rows.data() + plan_.row_begin[s];
    for (int i = 0; i < width; ++i) scratch.front_row.data()[first + i] = i;
    for (int i = 0; i < height; ++i) scratch.front_row.data()[rows[i]] = width + i;

    // The panel holds the pivot columns, then Y; the update matrix is separate.
    double* panel = scratch.panel.data();
    // Padding after the columns, so that loads past their end read nothing of Y, which other
    // threads write.
    double* y = panel + static_cast<size_t>(size) * static_cast<size_t>(width) + kReadBeyond;
    RawArray<double>& update = updates_[s];
    update = buffers_.take(static_cast<size_t>(height) * static_cast<size_t>(height));
    clear_lower(panel, size, width);
    clear_lower(update.data(), height, height);
    for (int j = 0; j < width; ++j) {
      double diagonal = 0;
      for (SparseMatrix::InnerIterator it(A_, plan_.order[first + j]); it; ++it) {
        const int row = plan_.index_of[it.row()];
        if (row < first + j) continue;
        panel[static_cast<size_t>(j) * size + scratch.front_row.data()[row]] = it.value();
        if (row == first + j) diagonal = it.value();
      }
      scratch.bounds[j] = smallest_pivot_ * diagonal;
    }
    const Front front = {panel, update.data(), width, height, size};
    for (int child : children_[s]) add(child, front, scratch);

    const DenseKernels& dense = dense_kernels();
    const int bad =
        dense.factor_pivot(width, panel, size, scratch.bounds.data(), scratch.inverse.data());
    if (bad >= 0) throw SingularMatrix(plan_.order[first + bad]);
    if (height == 0) return y;
    // Chunks don't depend on the number of threads, so that rounding doesn't either.
    const auto in_chunks = [&](const auto& work) {
      const auto chunk = [&](int i) { work(i * kChunk, std::min(height, (i + 1) * kChunk)); };
      run_tasks(pool, (height + kChunk - 1) / kChunk, chunk);
    };
    in_chunks([&](int begin, int end) {
      dense.solve_rows(width, end - begin, scratch.inverse.data(), panel + width + begin, size,
                       y + begin, height);
    });
    in_chunks([&](int begin, int end) {
      dense.subtract_products(width, height, begin, end, y, height, update.data(), height);
    });
    return y;
  }

 private:
  static void clear_lower(double* matrix, int rows, int columns) {
    for (int j = 0; j < columns; ++j, matrix += rows) std::fill(matrix + j, matrix + rows, 0.0);
  }

  /// Adds the update matrix of a child to a front, whose rows are in scratch.front_row.
  void add(int child, const Front& front, Scratch& scratch) {
    const int count = plan_.height(child);
    const int* rows = plan_.rows.data() + plan_.row_begin[child];
    std::vector<Run>& runs = scratch.runs;
    runs.clear();
    for (int i = 0; i < count; ++i) {
      const int at = scratch.front_row.data()[rows[i]] - i;
      if (runs.empty() || runs.back().at != at) runs.push_back({i, at});
    }
    runs.push_back({count, 0});
    const double* from = updates_[child].data();
    size_t of_column = 0;
    for (int j = 0; j < count; ++j, from += count) {
      if (j == runs[of_column + 1].first) ++of_column;
      const int column = j + runs[of_column].at;
      double* target = column < front.width
                           ? front.panel + static_cast<size_t>(column) * front.size
                           : front.update +
                                 static_cast<size_t>(column - front.width) * front.height -
                                 front.width;
      int i = j;
      for (size_t r = of_column; i < count; ++r) {
        double* shifted = target + runs[r].at;
        for (const int end = runs[r + 1].first; i < end; ++i) shifted[i] += from[i];
      }
    }
    buffers_.give_back(std::exchange(updates_[child], {}));
  }

  const SparseMatrix& A_;
  const SymbolicCholesky& plan_;
  double smallest_pivot_;
  Buffers buffers_;
  std::vector<RawArray<double>> updates_;  // update matrix of each supernode
  std::vector<std::vector<int>> children_;
};

}  // namespace

void SparseCholesky::factor(const SparseMatrix& A, const FactorOptions& options) {
  const SymbolicCholesky& plan = *symbolic_;
  Fronts fronts(A, plan, options.smallest_pivot);
  std::mutex reporting;
  int64_t done = 0;  // factored entries, guarded by the mutex
  const auto keep = [&](int s, const Fronts::Scratch& scratch, const double* y) {
    const int width = plan.width(s), height = plan.height(s);
    const auto write = [&](auto* out) {
      using Real = std::decay_t<decltype(*out)>;
      const auto from = [&out](const double* columns, int stride) {
        return [=, &out](int i, int j) {
          *out++ = static_cast<Real>(columns[size_t(j) * stride + i]);
        };
      };
      for_each_entry<Real>(width, height, from(scratch.inverse.data(), width), from(y, height));
    };
    if (precision_ == Precision::single)
      write(single_.data() + value_begin_[s]);
    else
      write(full_.data() + value_begin_[s]);
  };
  const auto run = [&](int first, int last, ThreadPool* pool) {
    Fronts::Scratch scratch(plan, first, last);
    int64_t since_report = 0;
    for (int s = first; s < last; ++s) {
      keep(s, scratch, fronts.eliminate(s, scratch, pool));
      since_report += value_begin_[s + 1] - value_begin_[s];
      if (!options.progress || since_report < entries() / 100) continue;
      const std::lock_guard<std::mutex> lock(reporting);
      done += std::exchange(since_report, 0);
      report(options.progress, static_cast<double>(done) / static_cast<double>(entries()),
             options.stage);
    }
  };
  run_tasks(options.pool, plan.domain_count(),
            [&](int d) { run(plan.domain_begin[d], plan.domain_begin[d + 1], nullptr); });
  run(plan.domain_begin[plan.domain_count()], plan.supernode_count(), options.pool);
}

SparseCholesky SparseCholesky::in_single(ThreadPool* pool) const {
  const SymbolicCholesky& plan = *symbolic_;
  SparseCholesky result(symbolic_, Precision::single);
  run_tasks(pool, plan.domain_count() + 1, [&](int section) {
    std::vector<double> inverse, below;  // column-major
    for (int s = plan.first_supernode(section); s < plan.first_supernode(section + 1); ++s) {
      const int width = plan.width(s), height = plan.height(s);
      // Zeros above the diagonal: groups of C_ss⁻¹ are larger in single precision and padded with
      // entries that those in double precision don't have.
      inverse.assign(size_t(width) * size_t(width), 0.0);
      below.resize(size_t(width) * size_t(height));
      const double* in = full_.data() + value_begin_[s];
      for_each_entry<double>(
          width, height, [&](int i, int j) { inverse[size_t(j) * width + i] = *in++; },
          [&](int i, int j) { below[size_t(j) * height + i] = *in++; });
      float* out = result.single_.data() + result.value_begin_[s];
      const auto write = [&](double value) { *out++ = static_cast<float>(value); };
      for_each_entry<float>(
          width, height, [&](int i, int j) { write(inverse[size_t(j) * width + i]); },
          [&](int i, int j) { write(below[size_t(j) * height + i]); });
    }
  });
  return result;
}

template <class Real>
FactorView<Real> SparseCholesky::view() const {
  const SymbolicCholesky& plan = *symbolic_;
  const Real* values;
  if constexpr (sizeof(Real) == sizeof(float))
    values = single_.data();
  else
    values = full_.data();
  return {plan.begin.data(), plan.row_begin.data(), plan.slotted_rows.data(), value_begin_.data(),
          values};
}

template <class Real>
void SparseCholesky::prepare(RawArray<Real>& x) const {
  const size_t size = 4 * static_cast<size_t>(symbolic_->slotted_size());
  if (x.size() != size) x = RawArray<Real>(size);
}

template <class Real>
void SparseCholesky::forward(int section, const double* right, RawArray<Real>& x,
                             Columns columns) const {
  const SymbolicCholesky& plan = *symbolic_;
  const auto clear = [&](int begin, int end) {
    std::fill(x.data() + 4 * std::ptrdiff_t(begin), x.data() + 4 * std::ptrdiff_t(end), Real(0));
  };
  clear(plan.section_begin(section), plan.section_begin(section + 1));
  if (section == plan.domain_count()) {
    for (size_t k = 0; k < plan.top_index_of_slot.size(); ++k) {
      const size_t slot = 4 * (size_t(size()) + k);
      for (size_t c = 0; c < 4; ++c)
        x.data()[4 * size_t(plan.top_index_of_slot[k]) + c] +=
            x.data()[slot + c] + static_cast<Real>(right[slot + c]);
    }
  } else {
    clear(size() + plan.slot_begin[section], size() + plan.slot_begin[section + 1]);
  }
  const KernelsOf<Real>& set = kernels().of<Real>();
  (columns == Columns::three ? set.forward : set.forward_four)(
      view<Real>(), plan.first_supernode(section), plan.first_supernode(section + 1), right,
      x.data());
}

void SparseCholesky::eliminate(int supernode, const double* right, double* x) const {
  kernels().of<double>().forward_four(view<double>(), supernode, supernode + 1, right, x);
}

template <class Real>
void SparseCholesky::backward(int section, RawArray<Real>& x, Columns columns) const {
  const SymbolicCholesky& plan = *symbolic_;
  if (section < plan.domain_count())
    for (int k = plan.slot_begin[section]; k < plan.slot_begin[section + 1]; ++k)
      std::copy_n(x.data() + 4 * std::ptrdiff_t(plan.top_index_of_slot[k]), 4,
                  x.data() + 4 * (std::ptrdiff_t(size()) + k));
  const KernelsOf<Real>& set = kernels().of<Real>();
  (columns == Columns::three ? set.backward : set.backward_four)(
      view<Real>(), plan.first_supernode(section), plan.first_supernode(section + 1), x.data());
}

RowMatrix SparseCholesky::solve(const RowMatrix& B, ThreadPool* pool) const {
  RowMatrix X(B.rows(), B.cols());
  SolveScratch scratch;
  for (FourColumns some(B); some.next();)
    solve_rows(
        some,
        [&](int row, const auto* x) {
          for (Index c = 0; c < some.width(); ++c) X(row, some.first() + c) = x[c];
        },
        scratch, pool, some.width() == 4 ? Columns::four : Columns::three);
  return X;
}

SparseMatrix SparseCholesky::in_order(const SparseMatrix& matrix) const {
  const Eigen::PermutationMatrix<Eigen::Dynamic> permutation(
      Eigen::Map<const Eigen::VectorXi>(symbolic_->index_of.data(), matrix.rows()));
  return matrix.twistedBy(permutation);
}

double SparseCholesky::bytes() const {
  const SymbolicCholesky& plan = *symbolic_;
  return static_cast<double>(full_.size() * sizeof(double) + single_.size() * sizeof(float) +
                             (plan.rows.size() + plan.slotted_rows.size() + 2 * plan.order.size()) *
                                 sizeof(int) +
                             value_begin_.size() * 2 * sizeof(int64_t));
}

template void SparseCholesky::prepare(RawArray<float>&) const;
template void SparseCholesky::prepare(RawArray<double>&) const;
template void SparseCholesky::forward(int, const double*, RawArray<float>&, Columns) const;
template void SparseCholesky::forward(int, const double*, RawArray<double>&, Columns) const;
template void SparseCholesky::backward(int, RawArray<float>&, Columns) const;
template void SparseCholesky::backward(int, RawArray<double>&, Columns) const;

}  // namespace dd
