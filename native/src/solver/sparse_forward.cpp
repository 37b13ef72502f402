// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/sparse_forward.h"

#include <algorithm>
#include <numeric>

namespace dd {

namespace {

/// Finds the supernodes on the paths from the entries of a column to the root of the tree.
class PathFinder {
 public:
  explicit PathFinder(const SymbolicCholesky& plan)
      : plan_(plan), seen_(size_t(plan.supernode_count()), -1) {
    for (int s = 0; s < plan.supernode_count(); ++s)
      supernode_of_.insert(supernode_of_.end(), size_t(plan.width(s)), s);
  }
  std::vector<int> from(const SparseMatrix& B, Index column) {
    std::vector<int> path;
    for (SparseMatrix::InnerIterator it(B, column); it; ++it)
      for (int s = supernode_of_[size_t(it.row())]; s >= 0 && seen_[size_t(s)] != column;
           s = plan_.parent[size_t(s)]) {
        seen_[size_t(s)] = column;
        path.push_back(s);
      }
    std::sort(path.begin(), path.end());
    return path;
  }

 private:
  const SymbolicCholesky& plan_;
  std::vector<Index> seen_;  // last column whose paths met the supernode
  std::vector<int> supernode_of_;
};

/// Forward substitution with up to four columns of B, through the supernodes on their paths only.
class FourPaths {
 public:
  explicit FourPaths(const SparseCholesky& factor)
      : factor_(factor),
        plan_(factor.symbolic()),
        right_(Rows::Zero(plan_.slotted_size(), 4)),
        x_(right_) {}

  void add(const SparseMatrix& B, int column, Index as, const std::vector<int>& path) {
    met_.insert(met_.end(), path.begin(), path.end());
    for (SparseMatrix::InnerIterator it(B, column); it; ++it) right_(it.row(), as) = it.value();
  }
  /// Returns the solution, slotted_size()×4: zero outside of the columns' paths.
  const Rows& solve() {
    std::sort(met_.begin(), met_.end());
    met_.erase(std::unique(met_.begin(), met_.end()), met_.end());
    const auto top = std::lower_bound(met_.begin(), met_.end(), plan_.domain_begin.back());
    for (auto s = met_.begin(); s != top; ++s) factor_.eliminate(*s, right_.data(), x_.data());
    for (size_t k = 0; k < plan_.top_index_of_slot.size(); ++k) {
      x_.row(plan_.top_index_of_slot[k]) += x_.row(plan_.size() + Index(k));
      x_.row(plan_.size() + Index(k)).setZero();
    }
    for (auto s = top; s != met_.end(); ++s) factor_.eliminate(*s, right_.data(), x_.data());
    return x_;
  }
  /// Forgets the columns.
  void clear() {
    for (int s : met_) {
      x_.middleRows(plan_.begin[size_t(s)], plan_.width(s)).setZero();
      right_.middleRows(plan_.begin[size_t(s)], plan_.width(s)).setZero();
    }
    met_.clear();
  }

 private:
  const SparseCholesky& factor_;
  const SymbolicCholesky& plan_;
  std::vector<int> met_;  // supernodes on the paths of any of the columns
  Rows right_, x_;
};

}  // namespace

SparseForward::SparseForward(const SparseCholesky& factor, const SparseMatrix& B, int64_t most)
    : symbolic_(&factor.symbolic()) {
  Paths paths;
  if (find_layout(B, most, paths)) eliminate(factor, B, paths);
}

bool SparseForward::find_layout(const SparseMatrix& B, int64_t most, Paths& paths) {
  const SymbolicCholesky& plan = *symbolic_;
  const size_t supernodes = size_t(plan.supernode_count());
  PathFinder finder(plan);
  column_begin_.assign(supernodes + 1, 0);
  int64_t entries = 0;
  for (Index column = 0; column < B.cols() && entries <= most; ++column) {
    paths.push_back(finder.from(B, column));
    for (int s : paths.back()) {
      ++column_begin_[size_t(s) + 1];
      entries += plan.width(s);
    }
  }
  if (entries > most) return false;
  value_begin_.push_back(0);
  for (size_t s = 0; s < supernodes; ++s) {
    value_begin_.push_back(value_begin_[s] + column_begin_[s + 1] * plan.width(int(s)));
    column_begin_[s + 1] += column_begin_[s];
  }
  columns_.resize(size_t(column_begin_.back()));
  values_ = RawArray<double>(size_t(entries));
  return true;
}

void SparseForward::eliminate(const SparseCholesky& factor, const SparseMatrix& B,
                              const Paths& paths) {
  const SymbolicCholesky& plan = *symbolic_;
  // Four columns at a time, sorted so that columns with similar paths go together.
  std::vector<int> order(paths.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return paths[size_t(a)] < paths[size_t(b)]; });
  std::vector<int64_t> next(column_begin_.begin(), column_begin_.end() - 1);
  FourPaths four(factor);
  for (size_t first = 0; first < order.size(); first += 4) {
    const size_t count = std::min<size_t>(4, order.size() - first);
    for (size_t c = 0; c < count; ++c)
      four.add(B, order[first + c], Index(c), paths[size_t(order[first + c])]);
    const Rows& x = four.solve();
    for (size_t c = 0; c < count; ++c)
      for (int s : paths[size_t(order[first + c])]) {
        const int64_t begin = column_begin_[size_t(s)];
        const int64_t stride = column_begin_[size_t(s) + 1] - begin;
        const int64_t entry = next[size_t(s)]++;
        columns_[size_t(entry)] = order[first + c];
        double* value = values_.data() + value_begin_[size_t(s)] + (entry - begin);
        for (int r = plan.begin[size_t(s)]; r < plan.begin[size_t(s) + 1]; ++r, value += stride)
          *value = x(r, Index(c));
      }
    four.clear();
  }
}

template <class Real>
void SparseForward::multiply(int section, const Rows& coefficients, Real* y) const {
  const SymbolicCholesky& plan = *symbolic_;
  std::fill(y + 4 * std::ptrdiff_t(plan.section_begin(section)),
            y + 4 * std::ptrdiff_t(plan.section_begin(section + 1)), Real(0));
  Rows own, sums;
  for (int s = plan.first_supernode(section); s < plan.first_supernode(section + 1); ++s) {
    const int64_t begin = column_begin_[size_t(s)];
    const int count = static_cast<int>(column_begin_[size_t(s) + 1] - begin);
    if (count == 0) continue;
    if (own.rows() < count) own.resize(count, 4);
    for (int k = 0; k < count; ++k) own.row(k) = coefficients.row(columns_[size_t(begin + k)]);
    sums.setZero(plan.width(s), 4);
    kernels().blend(plan.width(s), count, values_.data() + value_begin_[size_t(s)], own.data(),
                    sums.data(), sums.data());
    std::transform(sums.data(), sums.data() + sums.size(),
                   y + 4 * std::ptrdiff_t(plan.begin[size_t(s)]),
                   [](double value) { return static_cast<Real>(value); });
  }
}

template void SparseForward::multiply(int, const Rows&, float*) const;
template void SparseForward::multiply(int, const Rows&, double*) const;

double SparseForward::bytes() const {
  return static_cast<double>(values_.size() * sizeof(double) + columns_.size() * sizeof(int) +
                             (column_begin_.size() + value_begin_.size()) * sizeof(int64_t));
}

}  // namespace dd
