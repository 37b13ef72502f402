// SPDX-License-Identifier: GPL-3.0-or-later
// A bumpy strip, fixed at one end and pulled by a handle at the other; then a mistake.
#include <cmath>
#include <cstdio>
#include <detail_deform/detail_deform.hpp>

namespace dd = detail_deform;

int main() {
  constexpr int kColumns = 40;
  dd::Mesh mesh;
  std::vector<std::int32_t> roles;
  for (int v = 0; v < 2 * kColumns; ++v) {
    const int i = v / 2;
    mesh.positions.insert(mesh.positions.end(), {float(i), float(v % 2), 0.4f * float(i % 2)});
    roles.push_back(i < 2 ? DD_ROLE_FIXED : i == kColumns - 1 ? 0 : DD_ROLE_FREE);
  }
  for (std::int32_t v = 0; v + 3 < 2 * kColumns; v += 2)
    mesh.triangles.insert(mesh.triangles.end(), {v, v + 2, v + 1, v + 2, v + 3, v + 1});

  dd_bind_options how = dd::defaults(dd_bind_options_init);
  how.smoothness = DD_SMOOTHNESS_CURVATURE_VARIATION;
  dd::Deformer deformer = dd::bind(mesh, roles, 1, &how);
  std::vector<float> result;
  deformer.update({1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 6}, result);
  std::printf("%d vertices follow; the end is %.2f higher\n", deformer.info().free_count,
              double(result.back() - mesh.positions.back()));
  try {
    dd::bind(mesh, roles, 2);
  } catch (const dd::Error& error) {
    std::printf("%s\n", error.what());
    return error.subject == DD_SUBJECT_HANDLE && error.index == 1 ? 0 : 1;
  }
  return 1;
}
