// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "kernels/kernels.h"
#include "methods/examples/example_surface.h"
#include "reconstruction/gradients.h"

namespace dd {

/// The passes over triangles of posing by example, in blocks of kLanes triangles.
///
/// A 3×3 gradient T matters only within its triangle's plane, so it is stored as 3×2, scaled by
/// √(k_j A_j), k_j the triangle's stiffness, so that sums of squares are areas where k_j = 1. Each
/// triangle has three 2-vectors, from its cotangents, which have the factor k_j: g_0 = (a, 0),
/// g_1 = (b, k_j/(2a)), g_2 = −g_0 − g_1. Then g_k · g_l is the triangle's entry of L. The gradient
/// of positions x is x_0 g_0ᵀ + x_1 g_1ᵀ + x_2 g_2ᵀ, with the squared norm k_j A_j ‖G_j(x)‖². The
/// divergence of a gradient X at corner k is X g_k, the flux of corner_divergence(); it is finite
/// for triangles without area, too. All gradients are differences from rest, so a surface at rest
/// gives exact zeros.
template <class Real>
class ExamplePass {
 public:
  /// poisson: defines the active triangles, rows and targets of the passes; must outlive this.
  ExamplePass(const ExampleSurface& of, const PoissonSystem& poisson);

  int example_count() const { return example_count_; }

  /// Computes and stores the pose of these weights, (T_j − I) of the section's triangles, and adds
  /// its divergence to rows, for PoissonSystem::solve(). The functions below refer to this pose.
  void pose(int section, const Eigen::VectorXd& weights, bool rotation_only, double* rows);

  /// Squared norm of the pose, Σ k_j A_j ‖T_j − I‖² in the triangles' planes: its difference from
  /// rest, an area.
  double squared_size() const;

  /// Stores the residual (T_j − I) − G_j(offsets) and returns its squared norm. offsets: all rows.
  double misfit(const Rows& offsets);
  /// The divergence of the residual, n×4, by row.
  Rows misfit_divergence(int row_count);

  /// Allocates the derivatives. Must precede the first derivative().
  void allocate_derivatives() { derivatives_.resize(changes_.size()); }
  /// Stores the pose's derivative J_i by an example's weight and adds its divergence to rows.
  void derivative(int example, int section, double* rows);
  /// Half the second and first derivatives of the squared norm of the residual by the weights.
  /// position_responses: for each example L⁻¹ div J_i, all rows; its gradient is subtracted from
  /// the stored J_i, which leaves Ĵ_i.
  void second_order(const std::vector<Rows>& position_responses, Eigen::MatrixXd& hessian,
                    Eigen::VectorXd& gradient);

  double bytes() const;

 private:
  ExampleView<Real> view();
  /// Calls body(begin, end, chunk) for chunks of blocks. Their number depends on the mesh alone, so
  /// that sums over chunks don't depend on the number of threads.
  template <class Body>
  void by_chunks(const Body& body) const;
  int chunk_count() const;

  const PoissonSystem& poisson_;
  int example_count_;
  ActiveBlocks layout_;
  std::vector<ExampleBlock<Real>> blocks_;
  std::vector<ExampleChange<Real>> changes_;  // by block, then example
  std::vector<ExamplePose<Real>> pose_;
  std::vector<ExampleGradient<Real>> misfit_;
  std::vector<ExampleGradient<Real>> derivatives_;  // by block, then example
};

}  // namespace dd
