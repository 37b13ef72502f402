// SPDX-License-Identifier: GPL-3.0-or-later
#define DD_KERNEL_SET kAvx2Kernels
#define DD_KERNEL_NAME "avx2"
#define DD_EIGEN_NAME DdEigenAvx2
#include "kernels/kernels_impl.h"
