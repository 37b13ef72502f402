// SPDX-License-Identifier: GPL-3.0-or-later
#include "kernels/dense_kernels.h"

#include "kernels/kernels.h"

namespace dd {

const DenseKernels& dense_kernels() {
#ifdef DD_HAVE_AVX2_KERNELS
  static const bool wide = machine_has_avx2();
  if (wide) return kAvx2DenseKernels;
#endif
  return kBaselineDenseKernels;
}

}  // namespace dd
