// SPDX-License-Identifier: GPL-3.0-or-later
// The kernels, included once for each instruction set with namespace Eigen renamed for each. See
// Kernels for why nothing here may instantiate other templates of Eigen or of the standard library.
#define Eigen DD_EIGEN_NAME
#include <Eigen/Core>

#include "kernels/kernels_examples.h"
#include "kernels/kernels_solve.h"
#include "kernels/kernels_triangles.h"

namespace dd {

namespace {

/// Columns computed in a solve for three. In double precision a row fills one register either way.
template <class Real>
constexpr int kFewColumns = sizeof(Real) == 4 ? 3 : 4;

template <class Real>
constexpr KernelsOf<Real> kernels_of() {
  KernelsOf<Real> set{};
  set.forward = forward<kFewColumns<Real>, Real>;
  set.backward = backward<kFewColumns<Real>, Real>;
  set.forward_four = forward<4, Real>;
  set.backward_four = backward<4, Real>;
  set.gradient_pass = gradient_pass<Real>;
  set.rotation_pass = rotation_pass<Real>;
  set.mean_rotations = mean_rotations<Real>;
  set.rotated_flux_pass = rotated_flux_pass<Real>;
  set.turn_vectors = turn_vectors<Real>;
  set.arm_areas = arm_areas<Real>;
  set.example_pose = example_pose<Real>;
  set.example_misfit = example_misfit<Real>;
  set.example_misfit_divergence = example_misfit_divergence<Real>;
  set.example_derivative = example_derivative<Real>;
  set.example_second_order = example_second_order<Real>;
  return set;
}

}  // namespace

extern const Kernels DD_KERNEL_SET;
const Kernels DD_KERNEL_SET = {DD_KERNEL_NAME, kernels_of<float>(), kernels_of<double>(), blend};

}  // namespace dd
