// SPDX-License-Identifier: GPL-3.0-or-later
// All methods on the four deformations of the survey of Botsch and Sorkine (2008), meshes our own.
#include <cstdio>

#include "cases.h"
#include "deform/deformer.h"
#include "deform/split_motion.h"
#include "mesh/measures.h"
#include "timing.h"
#ifdef DD_HAVE_CGAL
#include "cgal_peer.h"
#endif

namespace {

struct Row {
  const char* name;
  dd::UpdateOptions options;
};

std::vector<Row> rows() {
  using dd::MethodKind;
  const auto shown = dd::Output::result;
  return {{"VarMin", {MethodKind::variational, {true, 0}, shown}},
          {"normal displacements", {MethodKind::normal, {}, shown}},
          {"  3 levels", {MethodKind::normal, {true, 0, 3}, shown}},
          {"displacement volumes", {MethodKind::volumes, {}, shown}},
          {"gradient", {MethodKind::gradient, {true, 0}, shown}},
          {"transfer, whole S", {MethodKind::transfer, {false, 0}, shown}},
          {"transfer, rotations", {MethodKind::transfer, {true, 0}, shown}},
          {"  refined, 1", {MethodKind::transfer, {true, 1}, shown}},
          {"  refined, 2", {MethodKind::transfer, {true, 2}, shown}},
          {"  refined, 4", {MethodKind::transfer, {true, 4}, shown}},
          {"  refined, 8", {MethodKind::transfer, {true, 8}, shown}},
          {"  refined, 16", {MethodKind::transfer, {true, 16}, shown}}};
}

using dd::bench::milliseconds_since;

void print(const char* name, const dd::Measures& m, double milliseconds) {
  std::printf("  %-24s %8d %8d %8.3f %8.2f %8.3f %8.3f %8.1f\n", name, m.intersecting_triangles,
              m.new_intersecting_pairs, m.stretch, m.normal_error, m.area_ratio, m.volume_ratio,
              milliseconds);
}

}  // namespace

int main() {
  using dd::bench::Clock;
  for (const dd::test::Case& one : dd::test::survey_cases()) {
    dd::Deformer deformer(one.mesh, one.roles, 1, dd::BindOptions{});
    std::vector<char> free;
    for (int role : one.roles) free.push_back(role == dd::kFree);
    std::printf("%s: %d triangles\n", one.name.c_str(), one.mesh.triangle_count());
    std::printf("  %-24s %8s %8s %8s %8s %8s %8s %8s\n", "", "faces", "new", "|S-R|", "normal",
                "area", "volume", "ms");
    const auto measured = [&](const dd::Positions& deformed) {
      return dd::measure(one.mesh, deformed, free, deformer.base(), deformer.deformed_base());
    };
    for (const Row& row : rows()) {
      deformer.update(one.motion.data(), row.options);  // prepares the method
      const auto start = Clock::now();
      const dd::Positions deformed =
          one.mesh.positions + deformer.update(one.motion.data(), row.options);
      const double time = milliseconds_since(start);
      print(row.name, measured(deformed), time);
    }
    for (int steps : {4, 12}) {
      dd::SplitMotion motion;
      motion.matrices.assign(one.motion.data(), one.motion.data() + 12);
      motion.steps = steps;
      dd::UpdateOptions options;
      options.of_method.refine = 4;
      const auto start = Clock::now();
      dd::Deformer first(one.mesh, one.roles, 1, dd::BindOptions{});
      const auto result = dd::split_update(first, motion, options);
      const double time = milliseconds_since(start);
      print(steps == 4 ? "  refined, 4, in 4 steps" : "  refined, 4, in 12 steps",
            measured(one.mesh.positions + result.offsets), time);
    }
#ifdef DD_HAVE_CGAL
    for (const auto& [name, method] :
         {std::pair{"CGAL ARAP, 200", dd::bench::CgalMethod::arap},
          {"CGAL SRE-ARAP, 200", dd::bench::CgalMethod::smoothed_rotations}}) {
      const auto start = Clock::now();
      const dd::Positions deformed =
          dd::bench::deform_with_cgal(one.mesh, one.roles, one.motion, method, 200).deformed;
      const double time = milliseconds_since(start);
      print(name, measured(deformed), time);
    }
#endif
  }
#ifndef DD_HAVE_CGAL
  std::printf("CGAL was not found: no comparison with it (install libcgal-dev).\n");
#endif
  return 0;
}
