// SPDX-License-Identifier: GPL-3.0-or-later
#define DD_KERNEL_SET kBaselineKernels
#define DD_KERNEL_NAME "baseline"
#define DD_EIGEN_NAME DdEigenBaseline
#include "kernels/kernels_impl.h"
