// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

namespace dd {

/// Triangles that go through the gradient pass together, one in each lane of the vector unit.
constexpr int kLanes = 8;

/// Shapes at rest of kLanes triangles with edges e1, e2 from their first corners: the inverse of
/// [e1 e2] in the triangle's own frame, lengths in |e1|.
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
  int32_t target[3][kLanes];  ///< where the divergence of its corners is added
  TriangleShape<Real> shape;  ///< of the source
  Real flux[2][3][kLanes];    ///< corner_divergence of corners 0, 1 in the rest frame of the source
};

/// kLanes triangles whose rotation from rest to now is asked for, structure of arrays.
template <class Real>
struct RotationBlock {
  int32_t source[3][kLanes];  ///< rows of the positions
  TriangleShape<Real> shape;
  Real from_rest[4][kLanes];  ///< quaternion x y z w that takes the rest frame to the world's
};

/// kLanes triangles that are turned by the mean of their corners' quaternions. Unused lanes have
/// zero flux.
template <class Real>
struct TurnBlock {
  int32_t corner[3][kLanes];  ///< rows of the quaternions
  int32_t target[3][kLanes];
  Real flux[2][3][kLanes];  ///< corner_divergence of corners 0 and 1
};

/// kLanes triangles of a surface that is posed by example, structure of arrays: see ExamplePass.
template <class Real>
struct ExampleBlock {
  int32_t corner[3][kLanes];  ///< rows of the offsets: the last corner's first, then 0 and 1
  int32_t target[3][kLanes];
  Real a[kLanes], b[kLanes], c[kLanes];  ///< g_0 = (a, 0), g_1 = (b, c)
  Real rest[6][kLanes];                  ///< the gradient of S, two columns
};
/// What an example does to a block's triangles: its rotations, and (U_ij − I) on their planes.
template <class Real>
struct ExampleChange {
  Real turn[3][kLanes];
  Real stretch[6][kLanes];
};
/// The pose taken: r = Σ w_i r_ij, the factors of r and r² in exp r and in its derivative, and
/// (T_j − I) and T_j as gradients.
template <class Real>
struct ExamplePose {
  Real turn[3][kLanes];
  Real sine[kLanes], versine[kLanes], cubic[kLanes];
  Real moved[6][kLanes], whole[6][kLanes];
  bool rotation_only;
};
template <class Real>
struct ExampleGradient {
  Real value[6][kLanes];
};
/// What the misfit makes of an example's second derivatives: a_i, K a_i + t_i, t_i.
template <class Real>
struct ExampleBend {
  Real spin[3][kLanes], pull[3][kLanes], stretch_pull[3][kLanes];
};
/// All that the passes of posing by example work on, by block, and then by example.
template <class Real>
struct ExampleView {
  int example_count;
  const ExampleBlock<Real>* blocks;
  const ExampleChange<Real>* changes;
  ExamplePose<Real>* poses;
  ExampleGradient<Real>* misfits;
  ExampleGradient<Real>* slopes;
};

/// The rows of a factor are stored in groups, each by columns. A group has as many rows as the
/// largest power of two, up to most, that is left. C_ss⁻¹ begins with its last rows: a group of it
/// is as long as its last row, filled up with zeros. So a solve reads all of a factor in one
/// direction, and back in the other.
constexpr int rows_together(int left, int most) {
  int rows = 1;
  while (2 * rows <= left && 2 * rows <= most) rows *= 2;
  return rows;
}
/// Most rows of a group of C_ss⁻¹, and of the rows below.
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

/// A factor as solves read it: see SparseCholesky and SymbolicCholesky.
template <class Real>
struct FactorView {
  const int32_t* begin;        ///< places of each supernode
  const int64_t* row_begin;    ///< of each, into slots
  const int32_t* slots;        ///< row of x for each row below
  const int64_t* value_begin;  ///< of each, into values
  /// Of each C_ss⁻¹, then the rows below, as rows_together() says.
  const Real* values;
};

/// Loops that come in two precisions: of what is constant in a frame and of what is computed from
/// it. Positions and right-hand sides are double always. x, right, quaternions: rows of 4.
template <class Real>
struct KernelsOf {
  /// Forward substitution through the supernodes first to last: x ← C⁻¹ (right + x) in their
  /// places, and what that takes from the rows below added to those of x. Of the first three
  /// columns; the fourth may be left with whatever.
  void (*forward)(const FactorView<Real>& factor, int first, int last, const double* right,
                  Real* x);
  /// Backward substitution, x ← C⁻ᵀ x.
  void (*backward)(const FactorView<Real>& factor, int first, int last, Real* x);
  /// The same of all four columns, which in single precision takes longer.
  void (*forward_four)(const FactorView<Real>& factor, int first, int last, const double* right,
                       Real* x);
  void (*backward_four)(const FactorView<Real>& factor, int first, int last, Real* x);

  /// For each triangle: S_j by (15) from its source corners in base, only its rotation if asked,
  /// and S_j · flux added to the rows of its target corners.
  void (*gradient_pass)(int block_count, const TriangleBlock<Real>* blocks, const double* base,
                        bool rotation_only, double* right_hand_side);

  /// The rotation of each triangle as a unit quaternion x y z w, w ≥ 0, kLanes rows of 4 a block.
  /// Zeros where a triangle has no area, at rest or now: it has no rotation of its own, turns
  /// nothing, and leaves means to its neighbours.
  void (*rotation_pass)(int block_count, const RotationBlock<Real>* blocks, const double* positions,
                        Real* quaternions);

  /// The means of rotations for blocks first to last of kLanes: out = the normalized
  /// Σ_k weights[k] · ± in[index[k]] in each lane, k from starts[b] to starts[b + 1], weights that
  /// sum to 1 there. Signs are made to agree where they don't.
  void (*mean_rotations)(int first, int last, const int* starts, const int32_t (*index)[kLanes],
                         const Real (*weights)[kLanes], const Real* in, Real* out);

  /// Adds each triangle's flux, turned by the mean of its corners' rotations, to the rows of its
  /// corners.
  void (*turn_pass)(int block_count, const TurnBlock<Real>* blocks, const Real* quaternions,
                    double* right_hand_side);

  /// Of blocks begin to end, as the functions of ExamplePass with these names say. offsets, rows:
  /// rows of 4.
  void (*example_pose)(const ExampleView<Real>& view, int begin, int end, const Real* weights,
                       bool rotation_only, double* rows);
  double (*example_misfit)(const ExampleView<Real>& view, int begin, int end,
                           const double* offsets);
  void (*example_misfit_divergence)(const ExampleView<Real>& view, int begin, int end,
                                    double* rows);
  void (*example_slope)(const ExampleView<Real>& view, int example, int begin, int end,
                        double* rows);
  /// bends: room for one of each example. sums: of each example its row up to the diagonal, then
  /// its gradient; added to.
  void (*example_second_order)(const ExampleView<Real>& view, int begin, int end,
                               const double* const* followed, ExampleBend<Real>* bends,
                               Real (*sums)[kLanes]);
};

/// The loops of a frame, compiled once for each instruction set. Rows are of 4 doubles (x y z and
/// one unused), all pointers to plain arrays: no template of the standard library may be
/// instantiated in these files, and of Eigen only under another name, because the linker could then
/// keep the wide version for everyone.
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

/// The widest set that this machine can run.
const Kernels& kernels();

extern const Kernels kBaselineKernels;
#ifdef DD_HAVE_AVX2_KERNELS
extern const Kernels kAvx2Kernels;
/// Whether this machine has AVX2 and FMA, and its system saves the registers.
bool machine_has_avx2();
#endif

}  // namespace dd
