/* SPDX-License-Identifier: GPL-3.0-or-later */
/* What bends a strip bends a longer one of the same topology. */
#include <detail_deform/detail_deform.h>
#include <math.h>
#include <stdio.h>

enum { N = 30, VERTICES = 2 * N, TRIANGLES = 2 * (N - 1) };

int main(void) {
  static float source[VERTICES][3], target[VERTICES][3], pose[VERTICES][3], result[VERTICES][3];
  static int32_t triangles[TRIANGLES][3];
  for (int v = 0; v < VERTICES; ++v) {
    const float x = (float)(v / 2), y = (float)(v % 2), z = 0.3f * (float)(v / 2 % 2);
    source[v][0] = x, source[v][1] = y, source[v][2] = z;
    target[v][0] = 1.5f * x, target[v][1] = y, target[v][2] = z;
    pose[v][0] = (20 + z) * sinf(x / 20), pose[v][1] = y, pose[v][2] = (20 + z) * cosf(x / 20) - 20;
  }
  for (int t = 0; t < TRIANGLES; ++t)
    for (int k = 0; k < 3; ++k) triangles[t][k] = t + (k == 0 || t % 2 == 0 ? k : 3 - k);

  const size_t stride = sizeof source[0];
  const dd_mesh from = {{source[0], VERTICES, stride}, triangles[0], TRIANGLES};
  const dd_mesh onto = {{target[0], VERTICES, stride}, triangles[0], TRIANGLES};
  const dd_points posed = {pose[0], VERTICES, stride};
  const dd_points_out out = {result[0], VERTICES, stride};
  dd_job* job = NULL;
  dd_transfer* transfer = NULL;
  if (dd_transfer_start(&from, &onto, NULL, 0, NULL, &job) != DD_OK ||
      dd_job_take_transfer(job, &transfer) != DD_OK ||
      dd_transfer_apply(transfer, &posed, NULL, &out) != DD_OK) {
    printf("%s\n", dd_last_message());
    return 1;
  }
  for (int v = 0; v < VERTICES; v += 8)
    printf("%6.2f %6.2f %6.2f\n", result[v][0], result[v][1], result[v][2]);
  dd_transfer_free(transfer);
  dd_job_free(job);
  return result[VERTICES - 1][2] < result[0][2] - 5 ? 0 : 1; /* its end is bent down, too */
}
