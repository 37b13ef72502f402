// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>

namespace dd {

/// n×3, one vertex a row.
using Positions = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;
/// m×3 vertex numbers, counter-clockwise.
using Triangles = Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor>;
/// One value a triangle corner, m×3.
using CornerValues = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;
/// Eigen's, but made of another or of an expression in two steps: where memory ends, Eigen's own
/// constructors keep what they have (3.4). And it moves.
class SparseMatrix : public Eigen::SparseMatrix<double> {
  using Base = Eigen::SparseMatrix<double>;

 public:
  SparseMatrix() = default;
  SparseMatrix(Eigen::Index rows, Eigen::Index cols) : Base(rows, cols) {}
  SparseMatrix(const SparseMatrix& other) : Base() { Base::operator=(other); }
  SparseMatrix(SparseMatrix&& other) : Base() { Base::swap(other); }  // even an empty one allocates
  template <class Expression>
  SparseMatrix(const Eigen::EigenBase<Expression>& expression) : Base() {
    Base::operator=(expression.derived());
  }
  SparseMatrix& operator=(const SparseMatrix& other) {
    Base::operator=(other);
    return *this;
  }
  SparseMatrix& operator=(SparseMatrix&& other) noexcept {
    Base::swap(other);
    return *this;
  }
  template <class Expression>
  SparseMatrix& operator=(const Eigen::EigenBase<Expression>& expression) {
    Base::operator=(expression.derived());
    return *this;
  }
};
using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
/// What a frame works on: x y z and one unused, so that a row is one or two vector registers.
using Rows = Eigen::Matrix<double, Eigen::Dynamic, 4, Eigen::RowMajor>;
using Eigen::Index;
/// All rows or columns of a matrix, as an index into it.
#if EIGEN_MAJOR_VERSION >= 5  // of 3.4 it is 4
inline const auto& kAllIndices = Eigen::placeholders::all;
#else
inline const auto& kAllIndices = Eigen::all;
#endif

}  // namespace dd
