// SPDX-License-Identifier: GPL-3.0-or-later
// The dense blocks of a factorization against Eigen's whole matrices, by each instruction set.
#include "kernels/dense_kernels.h"

#include <Eigen/Dense>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "catch.h"
#include "kernels/kernels.h"

namespace dd {

namespace {

using Eigen::MatrixXd;

std::vector<const DenseKernels*> sets() {
  std::vector<const DenseKernels*> result = {&kBaselineDenseKernels};
#ifdef DD_HAVE_AVX2_KERNELS
  if (machine_has_avx2()) result.push_back(&kAvx2DenseKernels);
#endif
  return result;
}

/// Symmetric, with eigenvalues between about 1 and 3.
MatrixXd definite(int size) {
  MatrixXd a(size, size);
  for (int i = 0; i < size; ++i)
    for (int j = 0; j < size; ++j)
      a(i, j) = (i == j ? 2 : 0) + 0.5 * std::cos(0.9 * (i - j)) * std::exp(-0.6 * std::abs(i - j));
  return a;
}

/// A block in the first rows of a taller matrix that is NaN elsewhere, so that a kernel which uses
/// other entries is found out. One more column, because kernels may read ahead without using it.
struct Framed {
  Framed(const MatrixXd& inside, int stride, bool lower)
      : rows(static_cast<int>(inside.rows())),
        all(MatrixXd::Constant(stride, inside.cols() + 1, kNan)) {
    for (Eigen::Index j = 0; j < inside.cols(); ++j)
      for (Eigen::Index i = lower ? j : 0; i < inside.rows(); ++i) all(i, j) = inside(i, j);
  }
  MatrixXd inside() const { return all.topLeftCorner(rows, all.cols() - 1); }
  /// All entries outside of the block are still NaN.
  bool whole() const {
    return all.bottomRows(all.rows() - rows).array().isNaN().all() &&
           all.rightCols<1>().array().isNaN().all();
  }
  static constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  int rows;
  MatrixXd all;
};

MatrixXd lower_of(const MatrixXd& a) { return a.triangularView<Eigen::Lower>(); }

const int kWidths[] = {1, 2, 3, 4, 5, 7, 8, 11, 12, 13, 16, 31, 63, 64, 65, 66, 67, 100, 129, 200};

}  // namespace

TEST_CASE("dense kernels: a pivot block's factor and its inverse") {
  for (const DenseKernels* set : sets())
    for (int width : kWidths) {
      INFO(width << (set == &kBaselineDenseKernels ? " baseline" : " wide"));
      const MatrixXd A = definite(width);
      Framed a(A, width + 9, true);
      std::vector<double> inverse(size_t(width * width + kReadBeyond), Framed::kNan);
      const std::vector<double> bounds(size_t(width), 1e-12);
      REQUIRE(set->factor_pivot(width, a.all.data(), width + 9, bounds.data(), inverse.data()) ==
              -1);
      const MatrixXd C = lower_of(a.inside());
      CHECK((C * C.transpose() - A).cwiseAbs().maxCoeff() < 1e-14);
      const MatrixXd X = Eigen::Map<const MatrixXd>(inverse.data(), width, width);
      CHECK((X * C - MatrixXd::Identity(width, width)).cwiseAbs().maxCoeff() < 1e-14);
      CHECK((X - lower_of(X)).cwiseAbs().maxCoeff() == 0);
      CHECK(a.whole());
      // The pivot block may end where memory ends: kernels don't read ahead of it.
      std::vector<double> alone(A.data(), A.data() + A.size());
      CHECK(set->factor_pivot(width, alone.data(), width, bounds.data(), inverse.data()) == -1);
      CHECK(
          (lower_of(Eigen::Map<MatrixXd>(alone.data(), width, width)) - C).cwiseAbs().maxCoeff() ==
          0);
    }
}

TEST_CASE("dense kernels: the first pivot that isn't above its bound is named") {
  for (const DenseKernels* set : sets())
    for (int width : {1, 4, 6, 64, 65, 150, 200})
      for (int bad : {0, width / 3, width / 2, width - 1}) {
        INFO(width << ", " << bad);
        std::vector<double> inverse(size_t(width * width + kReadBeyond)),
            bounds(size_t(width), 1e-12);
        const Framed whole(definite(width), width, true);
        Framed low = whole, negative = whole;
        bounds[size_t(bad)] = 10;
        CHECK(set->factor_pivot(width, low.all.data(), width, bounds.data(), inverse.data()) ==
              bad);
        bounds[size_t(bad)] = 1e-12;
        negative.all(bad, bad) = -5;
        CHECK(set->factor_pivot(width, negative.all.data(), width, bounds.data(), inverse.data()) ==
              bad);
        for (const double none : {Framed::kNan, std::numeric_limits<double>::infinity()}) {
          Framed infinite = whole;
          infinite.all(bad, bad) = none;
          CHECK(set->factor_pivot(width, infinite.all.data(), width, bounds.data(),
                                  inverse.data()) == bad);
        }
      }
}

TEST_CASE("dense kernels: rows below a pivot block, and their products taken from a front") {
  for (const DenseKernels* set : sets())
    for (int width : kWidths)
      for (int height : {1, 2, 3, 4, 6, 9, 12, 14, 24, 37, 96, 191, 192, 193, 250}) {
        if (width > 100 && height > 100) continue;
        INFO(width << ", " << height << (set == &kBaselineDenseKernels ? " baseline" : " wide"));
        const MatrixXd A = definite(width);
        const MatrixXd C = A.llt().matrixL();
        const MatrixXd X = C.inverse();
        std::vector<double> inverse(size_t(width * width + kReadBeyond), Framed::kNan);
        Eigen::Map<MatrixXd>(inverse.data(), width, width) = lower_of(X);
        MatrixXd B(height, width);
        for (int i = 0; i < height; ++i)
          for (int j = 0; j < width; ++j) B(i, j) = std::sin(1 + i + 0.7 * j);
        Framed b(B, height + 5, false), y(MatrixXd::Zero(height, width), height + 7, false);
        set->solve_rows(width, height, inverse.data(), b.all.data(), height + 5, y.all.data(),
                        height + 7);
        const MatrixXd Y = y.inside();
        CHECK((Y * C.transpose() - B).cwiseAbs().maxCoeff() < 1e-13);
        CHECK(y.whole());

        // In two parts, as two threads take them.
        const MatrixXd front = definite(height);
        Framed a(front, height + 2, true);
        const int cut = height / 3;
        for (const auto& [first, last] : {std::pair(cut, height), std::pair(0, cut)})
          set->subtract_products(width, height, first, last, y.all.data(), height + 7, a.all.data(),
                                 height + 2);
        const double size = 1 + (Y * Y.transpose()).cwiseAbs().maxCoeff();
        CHECK((lower_of(a.inside()) - lower_of(front - Y * Y.transpose())).cwiseAbs().maxCoeff() <
              1e-14 * size);
        CHECK(a.whole());
      }
}

}  // namespace dd
