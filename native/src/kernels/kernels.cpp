// SPDX-License-Identifier: GPL-3.0-or-later
#include "kernels/kernels.h"

#if defined(DD_HAVE_AVX2_KERNELS) && defined(_MSC_VER)
#include <immintrin.h>
#include <intrin.h>
#endif

namespace dd {

#ifdef DD_HAVE_AVX2_KERNELS
bool machine_has_avx2() {
#ifdef _MSC_VER
  int leaf[4];
  __cpuid(leaf, 0);
  if (leaf[0] < 7) return false;
  __cpuid(leaf, 1);
  const bool fma = leaf[2] & (1 << 12), saves_state = leaf[2] & (1 << 27);
  __cpuidex(leaf, 7, 0);
  const bool avx2 = leaf[1] & (1 << 5);
  return fma && avx2 && saves_state && (_xgetbv(0) & 6) == 6;
#else
  return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
#endif
}
#endif

const Kernels& kernels() {
#ifdef DD_HAVE_AVX2_KERNELS
  static const bool wide = machine_has_avx2();
  if (wide) return kAvx2Kernels;
#endif
  return kBaselineKernels;
}

}  // namespace dd
