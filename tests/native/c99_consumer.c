/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Binds a small strip through the C ABI and bends it, from C99: an example of its use. */
#include <math.h>
#include <stdio.h>

#include "detail_deform/detail_deform.h"

/* Programs that are compiled already contain these values. */
typedef char pinned_status[DD_OK == 0 && DD_ERROR_ARGUMENT == 1 && DD_ERROR_MESH == 2 &&
                                   DD_ERROR_REGION == 3 && DD_ERROR_NUMERIC == 4 &&
                                   DD_ERROR_MEMORY == 5 && DD_ERROR_CANCELLED == 6 &&
                                   DD_ERROR_BUSY == 7 && DD_ERROR_INTERNAL == 8
                               ? 1
                               : -1];
typedef char pinned_options[DD_ROLE_FREE == -1 && DD_ROLE_FIXED == -2 && DD_METRIC_SURFACE == 0 &&
                                    DD_METRIC_BASE == 1 && DD_METHOD_DETAIL == 0 &&
                                    DD_GRADIENTS_ROTATIONS == 0 && DD_GRADIENTS_WHOLE == 1 &&
                                    DD_OUTPUT_RESULT == 0 && DD_OUTPUT_BASE == 1 &&
                                    DD_VALUES_POSITIONS == 0 && DD_VALUES_OFFSETS == 1 &&
                                    DD_JOB_RUNNING == 0 && DD_JOB_DONE == 1 && DD_JOB_FAILED == 2
                                ? 1
                                : -1];

enum { kColumns = 6, kVertices = 2 * kColumns, kTriangles = 2 * (kColumns - 1) };

static int check(dd_status status, const char* call) {
  if (status != DD_OK) printf("%s: %d %s\n", call, (int)status, dd_last_message());
  return status == DD_OK;
}

int main(void) {
  float positions[3 * kVertices], out[3 * kVertices], again[3 * kVertices];
  int32_t triangles[3 * kTriangles], roles[kVertices];
  double lift[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0.5};
  dd_mesh mesh;
  dd_job* job = NULL;
  dd_progress progress = {.struct_size = sizeof progress};
  dd_bind_options bind_options;
  dd_update_options update_options;
  dd_points_out first, second;
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
  mesh.vertices.first = positions;
  mesh.vertices.count = kVertices;
  mesh.vertices.stride = 3 * sizeof(float);
  first.first = out;
  second.first = again;
  first.count = second.count = kVertices;
  first.stride = second.stride = mesh.vertices.stride;
  if (!check(dd_bind_options_init(&bind_options, sizeof bind_options), "dd_bind_options_init") ||
      !check(dd_update_options_init(&update_options, sizeof update_options),
             "dd_update_options_init"))
    return 1;
  mesh.triangles = triangles;
  mesh.triangle_count = kTriangles;
  if (!check(dd_deformer_bind_start(&mesh, roles, kVertices, 1, &bind_options, &job),
             "dd_deformer_bind_start"))
    return 1;
  if (!check(dd_job_finish(job), "dd_job_finish")) return 1;
  if (!check(dd_job_poll(job, &progress), "dd_job_poll")) return 1;
  if (!check(dd_job_take_deformer(job, &deformer), "dd_job_take_deformer")) return 1;
  dd_job_free(job);
  if (!check(dd_deformer_update(deformer, lift, 1, NULL, &first), "dd_deformer_update")) return 1;
  if (!check(dd_deformer_get_info(deformer, &info), "dd_deformer_get_info")) return 1;
  /* The same update as a job. The deformer may be freed while the job runs. */
  if (!check(dd_deformer_update_start(deformer, lift, 1, &update_options, &job),
             "dd_deformer_update_start"))
    return 1;
  dd_deformer_free(deformer);
  if (!check(dd_job_get_update(job, &second), "dd_job_get_update")) return 1;
  dd_job_free(job);

  failed |= progress.state != DD_JOB_DONE || progress.fraction != 1;
  for (i = 0; i < 3 * kVertices; ++i) failed |= !(fabs(out[i] - again[i]) < 1e-6);
  failed |= info.vertex_count != kVertices || info.handle_count != 1 || info.resting_example != -1;
  failed |= out[2] != positions[2];
  failed |= fabs(out[3 * kVertices - 1] - positions[3 * kVertices - 1] - 0.5) > 1e-6;
  for (i = 2; i < kVertices - 2; ++i) failed |= !(out[3 * i + 2] > positions[3 * i + 2]);
  return failed;
}
