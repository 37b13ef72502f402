// SPDX-License-Identifier: GPL-3.0-or-later
#define DD_KERNEL_SET kBaselineDenseKernels
#define DD_EIGEN_NAME DdEigenBaseline
#include "kernels/dense_kernels_impl.h"
