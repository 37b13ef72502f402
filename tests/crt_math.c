// SPDX-License-Identifier: GPL-3.0-or-later
//
// The complex functions of Windows' C library that Debian 12's Wine has no code for, as Windows
// passes complex numbers: as structs.
#include <complex.h>

typedef struct {
  float r, i;
} F;
typedef struct {
  double r, i;
} D;

#define COMPLEX(of) __builtin_complex((double)(of).r, (double)(of).i)
#define PARTS(type, z) ((type){__real__(z), __imag__(z)})
#define TO_COMPLEX(name)                 \
  F dd_##name##f(F z) {                  \
    double complex w = name(COMPLEX(z)); \
    return PARTS(F, w);                  \
  }                                      \
  D dd_##name(D z) {                     \
    double complex w = name(COMPLEX(z)); \
    return PARTS(D, w);                  \
  }
#define TO_REAL(name)                                  \
  float dd_##name##f(F z) { return name(COMPLEX(z)); } \
  double dd_##name(D z) { return name(COMPLEX(z)); }

TO_COMPLEX(cexp)
TO_COMPLEX(csin)
TO_COMPLEX(ccos)
TO_COMPLEX(ctan)
TO_COMPLEX(csinh)
TO_COMPLEX(ccosh)
TO_COMPLEX(ctanh)
TO_REAL(cabs)
TO_REAL(carg)
TO_REAL(creal)
TO_REAL(cimag)

F dd_cpowf(F a, F b) {
  double complex w = cpow(COMPLEX(a), COMPLEX(b));
  return PARTS(F, w);
}

D dd_cpow(D a, D b) {
  double complex w = cpow(COMPLEX(a), COMPLEX(b));
  return PARTS(D, w);
}
