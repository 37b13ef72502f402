/* SPDX-License-Identifier: GPL-3.0-or-later */
/* A bumpy strip, fixed at one end, pulled by a handle at each of two places. */
#include <detail_deform/detail_deform.h>
#include <math.h>
#include <stdio.h>

enum { N = 40, VERTICES = 2 * N, TRIANGLES = 2 * (N - 1) };

int main(void) {
  static float rest[VERTICES][3], result[VERTICES][3];
  static int32_t triangles[TRIANGLES][3], roles[VERTICES];
  for (int v = 0; v < VERTICES; ++v) { /* two rows of N vertices */
    const int i = v / 2;
    rest[v][0] = (float)i, rest[v][1] = (float)(v % 2), rest[v][2] = 0.4f * (float)(i % 2);
    roles[v] = i < 2 ? DD_ROLE_FIXED : i == N / 2 ? 0 : i == N - 1 ? 1 : DD_ROLE_FREE;
  }
  for (int t = 0; t < TRIANGLES; ++t)
    for (int k = 0; k < 3; ++k) triangles[t][k] = t + (k == 0 || t % 2 == 0 ? k : 3 - k);

  const dd_mesh mesh = {{rest[0], VERTICES, sizeof rest[0]}, triangles[0], TRIANGLES};
  const dd_points_out out = {result[0], VERTICES, sizeof result[0]};
  const double lift[2][12] = {{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 5},     /* upwards */
                              {0, 0, 1, 36, 0, 1, 0, 0, -1, 0, 0, 41}}; /* and a quarter turn */
  dd_job* job = NULL;
  dd_deformer* deformer = NULL;
  if (dd_deformer_bind_start(&mesh, roles, VERTICES, 2, NULL, &job) != DD_OK ||
      dd_job_take_deformer(job, &deformer) != DD_OK ||
      dd_deformer_update(deformer, lift[0], 2, NULL, &out) != DD_OK) {
    printf("%s\n", dd_last_message());
    return 1;
  }
  for (int v = 0; v < VERTICES; v += 8)
    printf("%6.2f %6.2f %6.2f\n", result[v][0], result[v][1], result[v][2]);
  dd_deformer_free(deformer);
  dd_job_free(job);
  return fabs(result[N][2] - rest[N][2] - 5) < 1e-4 ? 0 : 1; /* handle 0 is met */
}
