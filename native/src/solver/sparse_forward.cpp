// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/sparse_forward.h"

#include <algorithm>
#include <numeric>

namespace dd {

namespace {

/// The supernodes on the paths from the entries of a column to the root of the tree, ascending.
class Paths {
 public:
  explicit Paths(const SymbolicCholesky& e) : e_(e), seen_(size_t(e.supernode_count()), -1) {
    for (int s = 0; s < e.supernode_count(); ++s)
      supernode_of_.insert(supernode_of_.end(), size_t(e.width(s)), s);
  }
  std::vector<int> from(const SparseMatrix& B, Index column) {
    std::vector<int> path;
    for (SparseMatrix::InnerIterator it(B, column); it; ++it)
      for (int s = supernode_of_[size_t(it.row())]; s >= 0 && seen_[size_t(s)] != column;
           s = e_.parent[size_t(s)]) {
        seen_[size_t(s)] = column;
        path.push_back(s);
      }
    std::sort(path.begin(), path.end());
    return path;
  }

 private:
  const SymbolicCholesky& e_;
  std::vector<Index> seen_;  // last column whose paths met the supernode
  std::vector<int> supernode_of_;
};

}  // namespace

SparseForward::SparseForward(const SparseCholesky& factor, const SparseMatrix& B, int64_t most)
    : symbolic_(&factor.symbolic()) {
  const SymbolicCholesky& e = *symbolic_;
  const size_t supernodes = size_t(e.supernode_count());
  Paths paths(e);
  std::vector<std::vector<int>> path_of;
  column_begin_.assign(supernodes + 1, 0);
  int64_t entries = 0;
  for (Index column = 0; column < B.cols() && entries <= most; ++column) {
    path_of.push_back(paths.from(B, column));
    for (int s : path_of.back()) {
      ++column_begin_[size_t(s) + 1];
      entries += e.width(s);
    }
  }
  if (entries > most) return;
  value_begin_.push_back(0);
  for (size_t s = 0; s < supernodes; ++s) {
    value_begin_.push_back(value_begin_[s] + column_begin_[s + 1] * e.width(int(s)));
    column_begin_[s + 1] += column_begin_[s];
  }
  columns_.resize(size_t(column_begin_.back()));
  values_ = RawArray<double>(size_t(entries));

  // Four columns at a time, sorted so that columns with similar paths go together. All rows but
  // those on their paths stay zero.
  std::vector<int> order(path_of.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return path_of[size_t(a)] < path_of[size_t(b)]; });
  std::vector<int64_t> next(column_begin_.begin(), column_begin_.end() - 1);
  Rows right = Rows::Zero(e.slotted_size(), 4), x = right;
  for (size_t first = 0; first < order.size(); first += 4) {
    const size_t count = std::min<size_t>(4, order.size() - first);
    std::vector<int> met;
    for (size_t c = 0; c < count; ++c) {
      const int column = order[first + c];
      const std::vector<int>& path = path_of[size_t(column)];
      met.insert(met.end(), path.begin(), path.end());
      for (SparseMatrix::InnerIterator it(B, column); it; ++it)
        right(it.row(), Index(c)) = it.value();
    }
    std::sort(met.begin(), met.end());
    met.erase(std::unique(met.begin(), met.end()), met.end());
    const auto top = std::lower_bound(met.begin(), met.end(), e.domain_begin.back());
    for (auto s = met.begin(); s != top; ++s) factor.eliminate(*s, right.data(), x.data());
    for (size_t k = 0; k < e.slot_target.size(); ++k) {
      x.row(e.slot_target[k]) += x.row(e.size() + Index(k));
      x.row(e.size() + Index(k)).setZero();
    }
    for (auto s = top; s != met.end(); ++s) factor.eliminate(*s, right.data(), x.data());

    for (size_t c = 0; c < count; ++c)
      for (int s : path_of[size_t(order[first + c])]) {
        const int64_t begin = column_begin_[size_t(s)];
        const int64_t stride = column_begin_[size_t(s) + 1] - begin;
        const int64_t place = next[size_t(s)]++;
        columns_[size_t(place)] = order[first + c];
        double* value = values_.data() + value_begin_[size_t(s)] + (place - begin);
        for (int r = e.begin[size_t(s)]; r < e.begin[size_t(s) + 1]; ++r, value += stride)
          *value = x(r, Index(c));
      }
    for (int s : met) {
      x.middleRows(e.begin[size_t(s)], e.width(s)).setZero();
      right.middleRows(e.begin[size_t(s)], e.width(s)).setZero();
    }
  }
}

template <class Real>
void SparseForward::multiply(int part, const Rows& coefficients, Real* y) const {
  const SymbolicCholesky& e = *symbolic_;
  std::fill(y + 4 * std::ptrdiff_t(e.section_begin(part)),
            y + 4 * std::ptrdiff_t(e.section_begin(part + 1)), Real(0));
  Rows own, sums;
  for (int s = e.first_supernode(part); s < e.first_supernode(part + 1); ++s) {
    const int64_t begin = column_begin_[size_t(s)];
    const int count = static_cast<int>(column_begin_[size_t(s) + 1] - begin);
    if (count == 0) continue;
    if (own.rows() < count) own.resize(count, 4);
    for (int k = 0; k < count; ++k) own.row(k) = coefficients.row(columns_[size_t(begin + k)]);
    sums.setZero(e.width(s), 4);
    kernels().blend(e.width(s), count, values_.data() + value_begin_[size_t(s)], own.data(),
                    sums.data(), sums.data());
    std::transform(sums.data(), sums.data() + sums.size(),
                   y + 4 * std::ptrdiff_t(e.begin[size_t(s)]),
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
