// SPDX-License-Identifier: GPL-3.0-or-later
// All methods on the four deformations of the survey of Botsch and Sorkine (2008), meshes our own.
#include <chrono>
#include <cstdio>

#include "cases.h"
#include "deformer.h"
#include "measures.h"

namespace {

struct Row {
  const char* name;
  dd::UpdateOptions options;
};

std::vector<Row> rows() {
  using dd::MethodKind;
  const auto shown = dd::Shown::result;
  return {{"VarMin", {MethodKind::variational, {true, 0}, shown}},
          {"normal displacements", {MethodKind::normal, {}, shown}},
          {"  3 levels", {MethodKind::normal, {true, 0, 3}, shown}},
          {"gradient", {MethodKind::gradient, {true, 0}, shown}},
          {"transfer, whole S", {MethodKind::transfer, {false, 0}, shown}},
          {"transfer, rotations", {MethodKind::transfer, {true, 0}, shown}},
          {"  refined, 1", {MethodKind::transfer, {true, 1}, shown}},
          {"  refined, 2", {MethodKind::transfer, {true, 2}, shown}},
          {"  refined, 4", {MethodKind::transfer, {true, 4}, shown}},
          {"  refined, 8", {MethodKind::transfer, {true, 8}, shown}},
          {"  refined, 16", {MethodKind::transfer, {true, 16}, shown}}};
}

}  // namespace

int main() {
  for (const dd::test::Case& one : dd::test::survey_cases()) {
    dd::Deformer deformer(one.mesh, one.roles, 1, dd::BindOptions{});
    std::vector<char> free;
    for (int role : one.roles) free.push_back(role == dd::kFree);
    std::printf("%s: %d triangles\n", one.name.c_str(), one.mesh.triangle_count());
    std::printf("  %-22s %8s %8s %8s %8s %8s %8s\n", "", "faces", "new", "|S-R|", "normal", "area",
                "volume");
    for (const Row& row : rows()) {
      const dd::Positions deformed =
          one.mesh.positions + deformer.update(one.motion.data(), row.options);
      const dd::Measures m =
          dd::measure(one.mesh, deformed, free, deformer.base(), deformer.deformed_base());
      std::printf("  %-22s %8d %8d %8.3f %8.2f %8.3f %8.3f\n", row.name, m.intersecting_triangles,
                  m.new_intersecting_pairs, m.stretch, m.normal_error, m.area_ratio,
                  m.volume_ratio);
    }
  }
  return 0;
}
