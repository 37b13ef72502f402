// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>

namespace dd {

/// n×3, one vertex a row.
using Positions = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;
/// m×3 vertex numbers, counter-clockwise.
using Triangles = Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor>;
/// A value for each triangle corner, m×3.
using CornerValues = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;
/// Eigen's sparse matrix, but constructed empty and then assigned: if an allocation fails, Eigen
/// 3.4's own copy constructors leak. Also has move operations.
class SparseMatrix : public Eigen::SparseMatrix<double> {
  using Base = Eigen::SparseMatrix<double>;

 public:
  SparseMatrix() = default;
  SparseMatrix(Eigen::Index rows, Eigen::Index cols) : Base(rows, cols) {}
  SparseMatrix(const SparseMatrix& other) : Base() { Base::operator=(other); }
  SparseMatrix(SparseMatrix&& other) : Base() { Base::swap(other); }  // may throw: Base() allocates
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
/// Per-vertex data of a frame, n×4: x y z and one unused value, so that a row fills one or two
/// vector registers; or quaternions x y z w.
using Rows = Eigen::Matrix<double, Eigen::Dynamic, 4, Eigen::RowMajor>;
using Eigen::Index;
/// All rows or columns of a matrix, as an index into it.
#if EIGEN_MAJOR_VERSION >= 5  // it is 4 in Eigen 3.4
inline const auto& kAllIndices = Eigen::placeholders::all;
#else
inline const auto& kAllIndices = Eigen::all;
#endif

}  // namespace dd
