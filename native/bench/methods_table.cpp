// SPDX-License-Identifier: GPL-3.0-or-later
// All methods on the four deformations of the survey of Botsch and Sorkine (2008), and some of them
// beside other libraries' on the same shapes with four times the triangles:
//
//     methods_table [FOLDER] [CASE...]
//
// FOLDER: with a / or . in its name, where the survey's own files are (survey_files.h), in place of
// meshes of our own. CASE: the beginning of a case's name, as bar; all, if none is named.
#include <cstdio>
#include <exception>
#include <functional>
#include <string>
#include <vector>

#include "cases.h"
#include "deform/deformer.h"
#include "deform/split_motion.h"
#include "mesh/measures.h"
#include "smooth_arap_peer.h"
#include "survey_files.h"
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

/// The defaults of the add-on, except for the number of iterations.
dd::UpdateOptions refined(int iterations) {
  dd::UpdateOptions options = by(dd::MethodKind::detail);
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
          {"transfer, whole S", by(MethodKind::detail, false)},
          {"transfer, rotations", by(MethodKind::detail)},
          {"  smooth at the rims", refined(0)},
          {"  refined, 1", refined(1)},
          {"  refined, 2", refined(2)},
          {"  refined, 4", refined(4)},
          {"  refined, 8", refined(8)},
          {"  refined, 16", refined(16)}};
}

std::vector<Row> compared_rows() {
  return {{"transfer, rotations", by(dd::MethodKind::detail)},
          {"  smooth at the rims", refined(0)},
          {"  refined, 4", refined(4)},
          {"  refined, 8", refined(8)}};
}

using dd::Positions;
using dd::bench::Clock;
using dd::bench::milliseconds_since;
using dd::test::Case;

/// Measures of a case, printed as a line for each method.
class Table {
 public:
  explicit Table(const Case& one)
      : one_(one), deformer_(one.mesh, one.roles, 1, dd::BindOptions{}) {
    for (int role : one.roles) free_.push_back(role == dd::kFree);
    std::printf("%s: %d vertices, %d triangles\n", one.name.c_str(), one.mesh.vertex_count(),
                one.mesh.triangle_count());
    std::printf("  %-24s %8s %8s %8s %8s %8s %8s %8s %8s\n", "", "faces", "new", "|S-R|", "of all",
                "normal", "area", "volume", "ms");
  }

  void add(const Row& row) {
    deformer_.update(one_.motion.data(), row.options);  // prepares the method
    add(row.name, [&]() -> Positions {
      return one_.mesh.positions + deformer_.update(one_.motion.data(), row.options);
    });
  }

  void add(const char* name, const std::function<Positions()>& deform) {
    const auto start = Clock::now();
    const Positions deformed = deform();
    const double time = milliseconds_since(start);
    const dd::Measures m =
        dd::measure(one_.mesh, deformed, free_, deformer_.base(), deformer_.deformed_base());
    // Handles and fixed parts are stiff, and lower the mean the more the larger they are.
    const std::vector<char> all(free_.size(), 1);
    const double of_all = dd::measure(one_.mesh, deformed, all).stretch;
    std::printf("  %-24s %8d %8d %8.4f %8.4f %8.2f %8.3f %8.3f %8.1f\n", name,
                m.intersecting_triangles, m.new_intersecting_pairs, m.stretch, of_all,
                m.normal_error, m.area_ratio, m.volume_ratio, time);
    std::fflush(stdout);
  }

 private:
  const Case& one_;
  dd::Deformer deformer_;
  std::vector<char> free_;
};

Positions in_steps(const Case& one, int steps) {
  dd::SplitMotion motion;
  motion.matrices.assign(one.motion.data(), one.motion.data() + 12);
  motion.steps = steps;
  dd::Deformer first(one.mesh, one.roles, 1, dd::BindOptions{});
  return one.mesh.positions + dd::split_update(first, motion, refined(4)).offsets;
}

void add_peers(Table& table, const Case& one) {
#ifdef DD_HAVE_CGAL
  using dd::bench::CgalMethod;
  for (const auto& [name, method] : {std::pair{"CGAL ARAP, 200", CgalMethod::arap},
                                     {"CGAL SRE-ARAP, 200", CgalMethod::smoothed_rotations}})
    table.add(name, [&, algorithm = method] {
      return dd::bench::deform_with_cgal(one.mesh, one.roles, one.motion, algorithm, 200).deformed;
    });
#endif
  dd::bench::SmoothArapResult smooth;
  table.add("Smooth ARAP, 0.99", [&] {
    smooth = dd::bench::deform_with_smooth_arap(one.mesh, one.roles, one.motion);
    return smooth.deformed;
  });
  std::printf("  (%s after %d iterations)\n", smooth.converged ? "converged" : "ended",
              smooth.iterations);
}

void print_all(const Case& one) {
  Table table(one);
  for (const Row& row : rows()) table.add(row);
  table.add("  refined, 4, in 4 steps", [&] { return in_steps(one, 4); });
  table.add("  refined, 4, in 12 steps", [&] { return in_steps(one, 12); });
  add_peers(table, one);
}

void print_compared(const Case& one) {
  Table table(one);
  for (const Row& row : compared_rows()) table.add(row);
  add_peers(table, one);
}

bool is_wanted(const Case& one, const std::vector<std::string>& beginnings) {
  for (const std::string& beginning : beginnings)
    if (one.name.rfind(beginning, 0) == 0) return true;
  return beginnings.empty();
}

}  // namespace

int main(int count, char** arguments) {
  std::vector<std::string> wanted(arguments + 1, arguments + count);
  try {
    std::vector<Case> cases = dd::test::survey_cases();
    if (!wanted.empty() && wanted[0].find_first_of("/.") != std::string::npos) {
      cases = dd::bench::survey_from_files(wanted[0]);
      wanted.erase(wanted.begin());
    }
    for (const Case& one : cases) {
      if (!is_wanted(one, wanted)) continue;
      print_all(one);
      print_compared(dd::test::subdivided(one));
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
#ifndef DD_HAVE_CGAL
  std::printf("CGAL was not found: no comparison with it (install libcgal-dev).\n");
#endif
  return 0;
}
