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
  return {forward<kFewColumns<Real>, Real>,
          backward<kFewColumns<Real>, Real>,
          forward<4, Real>,
          backward<4, Real>,
          gradient_pass<Real>,
          rotation_pass<Real>,
          mean_rotations<Real>,
          turn_pass<Real>,
          example_pose<Real>,
          example_misfit<Real>,
          example_misfit_divergence<Real>,
          example_slope<Real>,
          example_second_order<Real>};
}

}  // namespace

extern const Kernels DD_KERNEL_SET;
const Kernels DD_KERNEL_SET = {DD_KERNEL_NAME, kernels_of<float>(), kernels_of<double>(), blend};

}  // namespace dd
