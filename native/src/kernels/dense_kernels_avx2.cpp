// SPDX-License-Identifier: GPL-3.0-or-later
#define DD_KERNEL_SET kAvx2DenseKernels
#define DD_EIGEN_NAME DdEigenAvx2
#include "kernels/dense_kernels_impl.h"
