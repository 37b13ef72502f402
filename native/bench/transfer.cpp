// SPDX-License-Identifier: GPL-3.0-or-later
// Deformation transfer between meshes: the time to prepare a source and a target, and of each pose,
// by the surface formulation alone, with the places of the source, by the original formulation with
// fourth points, and for a target that the source wears and that is kept outside of it; and the
// time to match two meshes by markers.
//
//   transfer [side]     of square sheets of side² vertices; 159: 50,000 triangles
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <vector>

#include "deform/mesh_transfer.h"
#include "match/registration.h"
#include "match/triangle_match.h"
#include "meshes.h"
#include "timing.h"
#include "wear/nearest_points.h"

namespace {

dd::Mesh sheet(int columns, int rows, double relief) {
  return dd::test::grid(columns, rows, [relief](double x, double y) {
    return relief * std::sin(9 * x) * std::cos(7 * y) + 0.004 * std::sin(80 * x) * std::sin(80 * y);
  });
}

dd::Positions rolled(const dd::Positions& p, double angle) {
  dd::Positions result(p.rows(), 3);
  for (dd::Index v = 0; v < p.rows(); ++v) {
    const double turn = angle * p(v, 0), radius = 1 / angle + p(v, 2);
    result.row(v) << radius * std::sin(turn), p(v, 1), radius * std::cos(turn) - 1 / angle;
  }
  return result;
}

}  // namespace

int main(int argc, char** argv) {
  const int side = argc > 1 ? std::atoi(argv[1]) : 159;
  const dd::Mesh source = sheet(side, side, 0.03), target = sheet(side + 20, side - 18, 0.06);
  std::printf("source %d triangles, target %d\n", source.triangle_count(), target.triangle_count());

  dd::Pairs markers;
  for (int i : {0, 1, 2})
    for (int j : {0, 1, 2})
      markers.push_back({i * (side - 1) / 2 * side + j * (side - 1) / 2,
                         i * (side + 19) / 2 * (side - 18) + j * (side - 19) / 2});
  dd::Match match;
  const double matching = dd::bench::milliseconds([&] {
    const dd::Positions fitted = dd::register_onto(source, target, markers, {});
    match = dd::match_triangles({fitted, source.triangles}, target, 0.1);
  });
  std::printf("matching by %d markers: %.1f s\n", int(markers.size()), matching / 1e3);

  dd::Mesh over = target;
  over.positions.col(2).array() += 0.15;
  dd::ThreadPool pool;
  const dd::Similarity as_they_stand;
  const dd::NearestPoints nearest(source, over, as_they_stand, pool);

  struct Way {
    const char* name;
    dd::Formulation formulation;
    dd::Placing placing;
    bool worn = false;
  };
  double first_pose = 0, first_once = 0;
  for (const Way& way :
       {Way{"surface", dd::Formulation::surface, dd::Placing::components},
        Way{"and places", dd::Formulation::surface, dd::Placing::vertices},
        Way{"fourth points", dd::Formulation::fourth_points, dd::Placing::components},
        Way{"worn", dd::Formulation::surface, dd::Placing::vertices, true}}) {
    dd::TransferOptions options;
    options.formulation = way.formulation;
    options.placing = way.placing;
    if (way.worn) {
      options.placement = &as_they_stand;
      options.worn = &nearest;
      options.gap = 0.01;
    }
    const dd::Correspondence pairs =
        way.worn ? nearest.correspondence(source, over) : match.correspondence;
    std::unique_ptr<dd::MeshTransfer> transfer;
    const double once = dd::bench::milliseconds([&] {
      transfer =
          std::make_unique<dd::MeshTransfer>(source, way.worn ? over : target, pairs, options);
    });
    std::vector<double> poses;
    for (int k = 1; k <= 15; ++k) {
      const dd::Positions pose = rolled(source.positions, 0.1 * k);
      poses.push_back(dd::bench::milliseconds([&] { transfer->apply(pose, false); }));
    }
    std::nth_element(poses.begin(), poses.begin() + 7, poses.end());
    std::printf("%-14s %7d unknowns, %8.0f non-zeros: once %7.1f ms, a pose %6.2f ms", way.name,
                transfer->unknowns(), transfer->nonzeros(), once, poses[7]);
    if (first_pose == 0) {
      first_pose = poses[7], first_once = once;
      std::printf("\n");
    } else {
      std::printf(" (%.1f and %.1f times the surface's)\n", once / first_once,
                  poses[7] / first_pose);
    }
  }
  return 0;
}
