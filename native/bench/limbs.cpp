// SPDX-License-Identifier: GPL-3.0-or-later
// Limbs with and without solidity: the least area of a cross-section over that at rest, the volume,
// stretch, intersecting faces, how far a twist is from even along the limb, and the times in one
// thread of a bind, of an update and of the first one, which finds the sections; then the survey's
// cases. With layers, volumetric ARAP on tetrahedra beside them, so many between the centre line
// and the surface.
//
//   limbs [density [layers]]     1: 1,682 vertices; 5: 42,002
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "deform/deformer.h"
#include "mesh/measures.h"
#include "tapered_limb.h"
#include "timing.h"
#include "volumetric_arap_peer.h"

namespace {

using dd::Positions;
using dd::bench::milliseconds;
using dd::test::Affine;
using dd::test::radians;
using dd::test::TaperedLimb;

struct Motion {
  std::string name;
  Affine matrix;
  double twist = 0;  // degrees
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();
};

std::vector<Motion> motions() {
  std::vector<Motion> all;
  for (const double degrees : {90.0, 135.0, 360.0, 720.0, 1080.0})
    all.push_back({"twisted " + std::to_string(int(degrees)),
                   TaperedLimb::twist(degrees),
                   degrees,
                   {0, 0, radians(degrees)}});
  all.push_back({"led down", TaperedLimb::led_down()});
  for (const double degrees : {70.0, 120.0, 170.0})
    all.push_back({"bent " + std::to_string(int(degrees)),
                   TaperedLimb::bend(degrees),
                   0,
                   {0, radians(degrees), 0}});
  return all;
}

std::vector<char> free_of(const std::vector<int>& roles) {
  std::vector<char> free;
  for (int role : roles) free.push_back(role == dd::kFree);
  return free;
}

void print_shape(const TaperedLimb& limb, const Positions& p) {
  const dd::Measures found = dd::measure(limb.mesh, p, free_of(limb.roles));
  std::printf("section %.3f  volume %.3f  stretch %.3f  intersecting %5d", limb.least_section(p),
              found.volume_ratio, found.stretch, found.intersecting_triangles);
}

void measure_limb(const std::string& name, const TaperedLimb& limb, double solidity) {
  dd::BindOptions one_thread;
  one_thread.threads = 1;
  one_thread.precision = dd::Precision::single;  // the library's default
  std::optional<dd::Deformer> bound;
  dd::UpdateOptions options;
  options.of_method.refined.iterations = 4;
  options.of_method.refined.rim_smoothing = 0.05;
  options.of_method.refined.solidity = solidity;
  std::vector<double> binds, firsts;
  for (int round = 0; round < 5; ++round) {
    binds.push_back(milliseconds([&] { bound.emplace(limb.mesh, limb.roles, 1, one_thread); }));
    firsts.push_back(
        milliseconds([&] { bound->update(motions().front().matrix.data(), options); }));
  }
  dd::Deformer& deformer = *bound;
  std::printf("%s, %d vertices, solidity %g: bind %.1f ms, first update %.1f ms, %.1f MB\n",
              name.c_str(), limb.mesh.vertex_count(), solidity, dd::bench::median(binds),
              dd::bench::median(firsts), 1e-6 * deformer.bytes());
  for (const Motion& motion : motions()) {
    options.turns.assign(motion.turn.data(), motion.turn.data() + 3);
    std::vector<double> times;
    Positions p;
    for (int round = 0; round < 5; ++round)
      times.push_back(milliseconds(
          [&] { p = limb.mesh.positions + deformer.update(motion.matrix.data(), options); }));
    std::printf("  %-13s ", motion.name.c_str());
    print_shape(limb, p);
    std::printf("  %8.2f ms", dd::bench::median(times));
    if (motion.twist > 0) std::printf("  uneven by %.3f", limb.unevenness(p, motion.twist));
    std::printf("\n");
  }
}

void measure_volumetric_arap(const std::string& name, const TaperedLimb& limb, int layers) {
  std::printf("%s, volumetric ARAP\n", name.c_str());
  for (const Motion& motion : motions()) {
    const auto found =
        dd::bench::deform_with_volumetric_arap(limb, layers, motion.matrix, motion.turn);
    std::printf("  %-13s ", motion.name.c_str());
    print_shape(limb, found.positions);
    std::printf("  %d tetrahedra, factor %.1f ms, %d iterations of %.2f ms\n", found.tets,
                found.factor_ms, found.iterations, found.iteration_ms);
  }
}

/// The survey's cases, on meshes of our own, of which the plane has no inside.
void measure_survey() {
  for (const dd::test::Case& one : dd::test::survey_cases()) {
    const std::vector<char> free = free_of(one.roles);
    dd::Deformer deformer(one.mesh, one.roles, 1, {});
    for (const double solidity : {0.0, 1.0}) {
      dd::UpdateOptions options;
      options.of_method.refined = {4, 0.009, 0.05, solidity};
      const Positions p = one.mesh.positions + deformer.update(one.motion.data(), options);
      const dd::Measures found = dd::measure(one.mesh, p, free);
      std::printf("%s, solidity %g: stretch %.3f  volume %.3f  intersecting %d\n", one.name.c_str(),
                  solidity, found.stretch, found.volume_ratio, found.intersecting_triangles);
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  const int density = argc > 1 ? std::atoi(argv[1]) : 1;
  const int layers = argc > 2 ? std::atoi(argv[2]) : 0;
  if (density < 1 || layers < 0) return std::fprintf(stderr, "limbs [density [layers]]\n"), 2;
  const std::pair<std::string, TaperedLimb> limbs[] = {{"tentacle", {0.5, 0.06, 1, density}},
                                                       {"cylinder", {0.3, 0.3, 1, density}},
                                                       {"flat limb", {0.5, 0.3, 0.5, density}},
                                                       {"relief", {0.4, 0.2, 1, density, 0.08}}};
  for (const auto& [name, limb] : limbs) {
    for (const double solidity : {0.0, 1.0}) measure_limb(name, limb, solidity);
    if (layers > 0) measure_volumetric_arap(name, limb, layers);
  }
  measure_survey();
}
