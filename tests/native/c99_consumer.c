/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Binds a small strip through the C ABI and bends it, from C99. */
#include <math.h>
#include <stdio.h>

#include "detail_deform/detail_deform.h"

/* These values are in other people's compiled programs. */
typedef char pinned_status[DD_OK == 0 && DD_ERROR_ARGUMENT == 1 && DD_ERROR_MESH == 2 &&
                                   DD_ERROR_REGION == 3 && DD_ERROR_NUMERIC == 4 &&
                                   DD_ERROR_MEMORY == 5 && DD_ERROR_CANCELLED == 6 &&
                                   DD_ERROR_BUSY == 7 && DD_ERROR_INTERNAL == 8
                               ? 1
                               : -1];
typedef char pinned_options[DD_ROLE_FREE == -1 && DD_ROLE_FIXED == -2 && DD_METRIC_SURFACE == 0 &&
                                    DD_METRIC_BASE == 1 && DD_OUTPUT_POSITIONS == 0 &&
                                    DD_OUTPUT_OFFSETS == 1 && DD_BIND_RUNNING == 0 &&
                                    DD_BIND_DONE == 1 && DD_BIND_FAILED == 2
                                ? 1
                                : -1];

enum { kColumns = 6, kVertices = 2 * kColumns, kTriangles = 2 * (kColumns - 1) };

static int check(int32_t status, const char* call) {
  if (status != DD_OK) printf("%s: %d %s\n", call, (int)status, dd_last_message());
  return status == DD_OK;
}

int main(void) {
  float positions[3 * kVertices], out[3 * kVertices];
  int32_t triangles[3 * kTriangles], roles[kVertices];
  double lift[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0.5};
  dd_bind* bind = NULL;
  dd_deformer* deformer = NULL;
  dd_deformer_info info;
  int i, failed = 0;

  if (dd_abi_version() != DD_ABI_VERSION) return 1;
  info.struct_size = sizeof info;
  for (i = 0; i < kVertices; ++i) {
    const int column = i / 2;
    positions[3 * i] = (float)column;
    positions[3 * i + 1] = (float)(i % 2);
    positions[3 * i + 2] = 0.25f * (float)(column % 2);
    roles[i] = column == 0 ? DD_ROLE_FIXED : column == kColumns - 1 ? 0 : DD_ROLE_FREE;
  }
  for (i = 0; i < kColumns - 1; ++i) {
    const int32_t corner = 2 * i;
    const int32_t quad[6] = {corner, corner + 2, corner + 1, corner + 2, corner + 3, corner + 1};
    int k;
    for (k = 0; k < 6; ++k) triangles[6 * i + k] = quad[k];
  }
  if (!check(dd_bind_start(positions, 3 * kVertices, triangles, 3 * kTriangles, roles, kVertices, 1,
                           NULL, &bind),
             "dd_bind_start"))
    return 1;
  if (!check(dd_bind_finish(bind, &deformer), "dd_bind_finish")) return 1;
  dd_bind_free(bind);
  if (!check(dd_deformer_update(deformer, lift, 12, NULL, out, 3 * kVertices),
             "dd_deformer_update"))
    return 1;
  if (!check(dd_deformer_get_info(deformer, &info), "dd_deformer_get_info")) return 1;
  dd_deformer_free(deformer);

  failed |= info.vertex_count != kVertices || info.handle_count != 1 || info.resting_example != -1;
  failed |= out[2] != positions[2];
  failed |= fabs(out[3 * kVertices - 1] - positions[3 * kVertices - 1] - 0.5) > 1e-6;
  for (i = 2; i < kVertices - 2; ++i) failed |= !(out[3 * i + 2] > positions[3 * i + 2]);
  return failed;
}
