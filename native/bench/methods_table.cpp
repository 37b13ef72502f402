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

dd::UpdateOptions by(dd::MethodKind method, bool rotation_only = true) {
  dd::UpdateOptions options;
  options.method = method;
  options.of_method.rotation_only = rotation_only;
  return options;
}

dd::UpdateOptions levels(int count) {
  dd::UpdateOptions options = by(dd::MethodKind::normal);
  options.of_method.levels = count;
  return options;
}

/// As the add-on does it unless told otherwise, but for the number of iterations.
dd::UpdateOptions refined(int iterations) {
  dd::UpdateOptions options = by(dd::MethodKind::transfer);
  options.of_method.refined = {iterations, 0.009, 0.05};
  return options;
}

std::vector<Row> rows() {
  using dd::MethodKind;
  return {{"VarMin", by(MethodKind::variational)},
          {"normal displacements", by(MethodKind::normal)},
          {"  3 levels", levels(3)},
          {"displacement volumes", by(MethodKind::volumes)},
          {"gradient", by(MethodKind::gradient)},
          {"transfer, whole S", by(MethodKind::transfer, false)},
          {"transfer, rotations", by(MethodKind::transfer)},
          {"  smooth at the rims", refined(0)},
          {"  refined, 1", refined(1)},
          {"  refined, 2", refined(2)},
          {"  refined, 4", refined(4)},
          {"  refined, 8", refined(8)},
          {"  refined, 16", refined(16)}};
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
      const dd::UpdateOptions options = refined(4);
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
