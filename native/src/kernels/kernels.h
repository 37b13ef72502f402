// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

namespace dd {

/// Triangles of a block, one in each vector lane. Derived: the floats of an AVX2 register.
constexpr int kLanes = 8;

/// Rest shapes of kLanes triangles with edges e1, e2 from their first corners: the inverse of
/// [e1 e2] in the triangle's own frame, in units of |e1|.
template <class Real>
struct TriangleShape {
  Real inverse_length[kLanes];  ///< 1/|e1|
  Real shear[kLanes];           ///< (e1·e2)/|e1×e2|
  Real inverse_height[kLanes];  ///< |e1|²/|e1×e2|
};

/// kLanes triangles, structure of arrays. A source is a row of the base positions; a target is a
/// row of the right-hand side. Unused lanes have zero flux.
template <class Real>
struct TriangleBlock {
  int32_t source[3][kLanes];  ///< corners of the triangle whose motion from B to B' gives S_j
  int32_t target[3][kLanes];  ///< rows to which its corners' divergence is added
  TriangleShape<Real> shape;  ///< of the source
  Real flux[2][3][kLanes];    ///< corner_divergence of corners 0, 1 in the rest frame of the source
};

/// kLanes triangles whose rotations from rest to the current pose are computed, structure of
/// arrays.
template <class Real>
struct RotationBlock {
  int32_t source[3][kLanes];  ///< rows of the positions
  TriangleShape<Real> shape;
  Real from_rest[4][kLanes];  ///< quaternion x y z w from the rest frame to the world axes
};

/// kLanes triangles whose flux is rotated by the mean of their corners' quaternions. Unused lanes
/// have zero flux.
template <class Real>
struct RotatedFluxBlock {
  int32_t corner[3][kLanes];  ///< rows of the quaternions
  int32_t target[3][kLanes];
  Real flux[2][3][kLanes];  ///< corner_divergence of corners 0 and 1
};

/// kLanes triangles with arms at their corners, for FoldLimits. Unused lanes have no arms.
template <class Real>
struct ArmBlock {
  int32_t corner[3][kLanes];       ///< rows of the quaternions
  Real centre_edge[2][3][kLanes];  ///< between the corners' centres, from corner 0 to the others
  Real arm_edge[2][3][kLanes];     ///< the same of their arms
  Real normal[3][kLanes];          ///< the triangle's, over twice its area
};

/// kLanes triangles of a surface posed by example, structure of arrays: see ExamplePass.
template <class Real>
struct ExampleBlock {
  int32_t corner[3][kLanes];  ///< rows of the offsets of corners 2, 0, 1
  int32_t target[3][kLanes];
  Real a[kLanes], b[kLanes], c[kLanes];  ///< g_0 = (a, 0), g_1 = (b, c)
  Real rest[6][kLanes];                  ///< the gradient of S, 3×2 by columns
};
/// Deformation gradients of an example on a block: rotation vectors r_ij, and U_ij − I applied to
/// the gradient of S.
template <class Real>
struct ExampleChange {
  Real turn[3][kLanes];
  Real stretch[6][kLanes];
};
/// The current pose: the rotation vector r = Σ w_i r_ij; the coefficients of [r]× and [r]×², in
/// exp r and in its left Jacobian; change and gradient: T_j − I and T_j applied to S's gradient.
template <class Real>
struct ExamplePose {
  Real turn[3][kLanes];
  Real sine[kLanes], versine[kLanes], cubic[kLanes];
  Real change[6][kLanes], gradient[6][kLanes];
  bool rotation_only;
};
template <class Real>
struct ExampleGradient {
  Real value[6][kLanes];
};
/// Of one example i, the vectors a_i, K a_i + t_i and t_i whose dot products with those of another
/// example give the misfit's part of the second derivatives, see take_second_order().
template <class Real>
struct ExampleSecondOrder {
  Real spin[3][kLanes], pull[3][kLanes], stretch_pull[3][kLanes];
};
/// The arrays that the passes of posing by example work on, indexed by block, then by example.
template <class Real>
struct ExampleView {
  int example_count;
  const ExampleBlock<Real>* blocks;
  const ExampleChange<Real>* changes;
  ExamplePose<Real>* poses;
  ExampleGradient<Real>* misfits;
  ExampleGradient<Real>* derivatives;
};

/// A supernode's values are stored in groups of consecutive rows, each group column-major: first
/// C_ss⁻¹, beginning with its last rows, then the rows below. A group of C_ss⁻¹ has as many columns
/// as its last row has entries; shorter rows are padded with zeros. In this order forward
/// substitution reads the whole factor in one direction, and backward substitution in the other.
///
/// Returns the number of rows of the next group, the largest power of two that is neither above
/// `most` nor above `left`, the number of rows that are not in a group yet.
constexpr int rows_together(int left, int most) {
  int rows = 1;
  while (2 * rows <= left && 2 * rows <= most) rows *= 2;
  return rows;
}
/// Most rows of a group of C_ss⁻¹, and of the rows below it. In single precision 8 rows are a
/// vector, and the sums of 4 vectors and three columns are kept in registers.
template <class Real>
constexpr int kTriangleRows = sizeof(Real) == 4 ? 8 : 4;
template <class Real>
constexpr int kRowsBelow = sizeof(Real) == 4 ? 32 : 4;

template <class Real>
constexpr int64_t packed_triangle_size(int width) {
  int64_t size = 0;
  for (int left = width, rows = 0; left > 0; left -= rows) {
    rows = rows_together(left, kTriangleRows<Real>);
    size += int64_t{rows} * left;
  }
  return size;
}

/// A factor as the solve kernels read it: see SparseCholesky and SymbolicCholesky.
template <class Real>
struct FactorView {
  const int32_t* begin;         ///< first row of each supernode
  const int64_t* row_begin;     ///< start of each supernode in slotted_rows
  const int32_t* slotted_rows;  ///< row of x for each row below
  const int64_t* value_begin;   ///< start of each supernode in values
  /// For each supernode C_ss⁻¹, then the rows below, in groups: see rows_together().
  const Real* values;
};

/// Loops in two precisions: Real is that of a bind's constants and of intermediate values.
/// Positions and right-hand sides are always double. x, right, quaternions: n×4.
template <class Real>
struct KernelsOf {
  /// Forward substitution through the supernodes first to last − 1: x ← C⁻¹ (right + x) at their
  /// rows, and its products with the rows below are subtracted from those rows of x. Solves the
  /// first three columns; the fourth is undefined.
  void (*forward)(const FactorView<Real>& factor, int first, int last, const double* right,
                  Real* x);
  /// Backward substitution through the same supernodes, x ← C⁻ᵀ x.
  void (*backward)(const FactorView<Real>& factor, int first, int last, Real* x);
  /// The same for all four columns, which is slower in single precision.
  void (*forward_four)(const FactorView<Real>& factor, int first, int last, const double* right,
                       Real* x);
  void (*backward_four)(const FactorView<Real>& factor, int first, int last, Real* x);

  /// For each triangle: S_j (15) from its source corners in base, or only its rotation; adds
  /// S_j · flux to the rows of its target corners.
  void (*gradient_pass)(int block_count, const TriangleBlock<Real>* blocks, const double* base,
                        bool rotation_only, double* right_hand_side);

  /// The rotation of each triangle from rest as a unit quaternion x y z w, w ≥ 0, kLanes rows of 4
  /// a block. Zeros if a triangle has no area, at rest or now, as its rotation is undefined: zeros
  /// don't contribute to means, and rotate flux by the identity.
  void (*rotation_pass)(int block_count, const RotationBlock<Real>* blocks, const double* positions,
                        Real* quaternions);

  /// Weighted means of quaternions for the blocks first to last − 1: in each lane out is the
  /// normalized Σ_k ± weights[k] · in[index[k]], k from starts[b] to starts[b + 1] − 1. The weights
  /// of a lane sum to 1. Signs are made to agree if the plain sum is short.
  void (*mean_rotations)(int first, int last, const int* starts, const int32_t (*index)[kLanes],
                         const Real (*weights)[kLanes], const Real* in, Real* out);

  /// Adds each triangle's flux, rotated by the mean of its corners' quaternions, to the rows of its
  /// target corners.
  void (*rotated_flux_pass)(int block_count, const RotatedFluxBlock<Real>* blocks,
                            const Real* quaternions, double* right_hand_side);

  /// By row, R r − r of a vector r whose fourth value is 0: 2 (w (v × r) + v × (v × r)) / |q|²,
  /// with v and w the parts of a quaternion q of any length; 0 if q = 0.
  void (*turn_vectors)(int count, const Real* quaternions, const double* vectors, double* changes);

  /// By lane, of a triangle whose corners' arms change by their displacements, and whose centres
  /// are turned by the mean of their quaternions: its area over that before, seen along the normal
  /// as the mean turns it. displacements: rows as the quaternions.
  void (*arm_areas)(int block_count, const ArmBlock<Real>* blocks, const Real* quaternions,
                    const double* displacements, Real* areas);

  /// ExamplePass's functions of these names, for the blocks begin to end − 1. offsets, rows: n×4.
  void (*example_pose)(const ExampleView<Real>& view, int begin, int end, const Real* weights,
                       bool rotation_only, double* rows);
  double (*example_misfit)(const ExampleView<Real>& view, int begin, int end,
                           const double* offsets);
  void (*example_misfit_divergence)(const ExampleView<Real>& view, int begin, int end,
                                    double* rows);
  void (*example_derivative)(const ExampleView<Real>& view, int example, int begin, int end,
                             double* rows);
  /// second_order: scratch, one for each example. sums, added to: for each example its row of the
  /// Hessian's lower triangle, then its entry of the gradient.
  void (*example_second_order)(const ExampleView<Real>& view, int begin, int end,
                               const double* const* position_responses,
                               ExampleSecondOrder<Real>* second_order, Real (*sums)[kLanes]);
};

/// The loops of a frame, compiled once for each instruction set. Rows have 4 doubles, x y z and one
/// unused; all pointers are to plain arrays. These files must not instantiate templates of the
/// standard library, and Eigen's only with its namespace renamed: the linker may otherwise keep the
/// AVX2 instance for all callers.
struct Kernels {
  const char* name;

  KernelsOf<float> single;
  KernelsOf<double> full;
  template <class Real>
  const KernelsOf<Real>& of() const;

  /// out[r] = rest[r] + Σ_k weights[r][k] · coefficients[k], for row_count rows of 4.
  void (*blend)(int row_count, int term_count, const double* weights, const double* coefficients,
                const double* rest, double* out);
};

template <>
inline const KernelsOf<float>& Kernels::of<float>() const {
  return single;
}
template <>
inline const KernelsOf<double>& Kernels::of<double>() const {
  return full;
}

/// The set of the widest vector instructions that this machine has.
const Kernels& kernels();

extern const Kernels kBaselineKernels;
#ifdef DD_HAVE_AVX2_KERNELS
extern const Kernels kAvx2Kernels;
/// Whether this machine has AVX2 and FMA, and its operating system saves their registers.
bool machine_has_avx2();
#endif

}  // namespace dd
