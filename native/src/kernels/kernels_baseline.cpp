// SPDX-License-Identifier: GPL-3.0-or-later
#define DD_KERNEL_SET kBaselineKernels
#define DD_KERNEL_NAME "baseline"
#include "kernels/kernels_impl.h"
