// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

namespace dd {

/// Triangles that go through the gradient pass together, one in each lane of the vector unit.
constexpr int kLanes = 8;

/// kLanes triangles, structure of arrays. A source is a row of the base positions; a target is a
/// row of the right-hand side. Unused lanes have zero flux.
struct TriangleBlock {
  int32_t source[3][kLanes];      ///< corners of the triangle whose motion from B to B' gives S_j
  int32_t target[3][kLanes];      ///< where the divergence of its corners is added
  double inverse_length[kLanes];  ///< with edges e1, e2 of the source triangle at rest:
  double shear[kLanes];           ///<   1/|e1|, (e1·e2)/(|e1|·|e1×e2|), |e1|/|e1×e2|
  double inverse_height[kLanes];  ///<   (the inverse of [e1 e2] in the triangle's own frame)
  double flux[2][3]
             [kLanes];  ///< corner_divergence of corners 0 and 1 in the rest frame of the source
};

/// kLanes triangles whose rotation from rest to now is asked for, structure of arrays.
struct RotationBlock {
  int32_t source[3][kLanes];                                             ///< rows of the positions
  double inverse_length[kLanes], shear[kLanes], inverse_height[kLanes];  ///< as in TriangleBlock
  double from_rest[4][kLanes];  ///< quaternion x y z w that takes the rest frame to the world's
};

/// kLanes triangles that are turned by a quaternion each. Unused lanes have zero flux.
struct TurnBlock {
  int32_t target[3][kLanes];
  double flux[2][3][kLanes];  ///< corner_divergence of corners 0 and 1
};

/// A triangular matrix is stored row by row up to the diagonal, but four rows together to the same
/// length: the first of four up to the diagonal of the last. The rows beyond the last four are single.
constexpr int64_t packed_triangle_size(int64_t width) {
  const int64_t fours = width / 4;
  return 8 * fours * (fours + 1) + (width * (width + 1) - 4 * fours * (4 * fours + 1)) / 2;
}

/// Length of row i in it.
constexpr int packed_triangle_row(int i, int width) {
  return i < (width & ~3) ? (i | 3) + 1 : i + 1;
}

/// Rows of a factor that a vector register takes together.
template <class Real>
constexpr int kRowsTogether = 1;
template <>
constexpr int kRowsTogether<float> = 8;

/// A factor as solves read it: see SparseCholesky and Elimination.
template <class Real>
struct FactorView {
  const int32_t* begin;        ///< places of each supernode
  const int64_t* row_begin;    ///< of each, into slots
  const int32_t* slots;        ///< row of x for each row below
  const int64_t* value_begin;  ///< of each, into values
  /// C_ss⁻¹ as a packed triangle, then the rows below: as many as kRowsTogether by columns, those
  /// that are left by rows.
  const Real* values;
};

/// Loops that come in two precisions. x, right: rows of 4.
template <class Real>
struct KernelsOf {
  /// Forward substitution through the supernodes first to last: x ← C⁻¹ (right + x) in their places,
  /// and what that takes from the rows below added to those of x.
  void (*forward)(const FactorView<Real>& factor, int first, int last, const double* right,
                  Real* x);
  /// Backward substitution, x ← C⁻ᵀ x.
  void (*backward)(const FactorView<Real>& factor, int first, int last, Real* x);
};

/// The loops of a frame, compiled once for each instruction set. Rows are of 4 doubles (x y z and
/// one unused), all pointers to plain arrays: no Eigen or standard template may be instantiated in
/// these files, because the linker could then keep the wide version for everyone.
struct Kernels {
  const char* name;

  KernelsOf<float> single;
  KernelsOf<double> full;
  template <class Real>
  const KernelsOf<Real>& of() const;

  /// out[r] = rest[r] + Σ_k weights[r][k] · coefficients[k], for row_count rows of 4.
  void (*blend)(int row_count, int term_count, const double* weights, const double* coefficients,
                const double* rest, double* out);

  /// For each triangle: S_j by (15) from its source corners in base, only its rotation if asked,
  /// and S_j · flux added to the rows of its target corners.
  void (*gradient_pass)(int block_count, const TriangleBlock* blocks, const double* base,
                        bool rotation_only, double* right_hand_side);

  /// The rotation of each triangle as a unit quaternion x y z w, w ≥ 0, kLanes rows of 4 a block.
  void (*rotation_pass)(int block_count, const RotationBlock* blocks, const double* positions,
                        double* quaternions);

  /// The mean of rotations: out[i] = the normalized Σ_k weights[k] · ± in[index[k]], k from starts[i]
  /// to starts[i + 1], weights that sum to 1 there. Signs are made to agree where they don't, which
  /// shows in a short sum.
  void (*mean_rotations)(int count, const int* starts, const int* index, const double* weights,
                         const double* in, double* out);

  /// Adds each triangle's flux, turned by its quaternion, to the rows of its corners.
  void (*turn_pass)(int block_count, const TurnBlock* blocks, const double* quaternions,
                    double* right_hand_side);
};

template <>
inline const KernelsOf<float>& Kernels::of<float>() const {
  return single;
}
template <>
inline const KernelsOf<double>& Kernels::of<double>() const {
  return full;
}

/// The widest set that this machine can run.
const Kernels& kernels();

extern const Kernels kBaselineKernels;
#ifdef DD_HAVE_AVX2_KERNELS
extern const Kernels kAvx2Kernels;
/// Whether this machine has AVX2 and FMA, and its system saves the registers.
bool machine_has_avx2();
#endif

}  // namespace dd
