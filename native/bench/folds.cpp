// SPDX-License-Identifier: GPL-3.0-or-later
// New self-intersections of poses of any meshes, without refinement, with four iterations, the same
// with Solidity 1, and by Smooth ARAP:
//
//     folds FILE...
//
// FILE: .off or .obj. In six poses of each, the last 15% along an axis, either way, are pulled out
// by 12% of the box and turned by 40°; the next 30% are free, the rest is fixed.
#include <algorithm>
#include <cstdio>
#include <exception>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "cases.h"
#include "deform/deformer.h"
#include "mesh/geodesic_distances.h"
#include "mesh/intersections.h"
#include "mesh_files.h"
#include "pulled_end.h"
#include "smooth_arap_peer.h"

namespace {

using dd::Index;
using dd::Mesh;

/// Intersecting pairs of triangles that don't intersect at rest. Distances are over the surface, as
/// fractions of size_. between_parts: farther apart than 0.3; at_rims: within 0.06 of a rim;
/// inside: all others.
struct Folds {
  int at_rims = 0, inside = 0, between_parts = 0;
  int count() const { return at_rims + inside + between_parts; }
};

class Limb {
 public:
  Limb(const Mesh& mesh, int axis, bool last) : mesh_(mesh) {
    dd::bench::PulledEnd end = dd::bench::pulled_end(mesh, axis, last, 0.55);
    roles_ = std::move(end.roles);
    motion_ = end.motion;
    const auto of_rest = dd::intersecting_pairs(mesh);
    at_rest_.insert(of_rest.begin(), of_rest.end());
    find_rims();
  }

  /// The new pairs after each of several refinements, by one bind.
  std::vector<Folds> folds(const std::vector<dd::Refined>& refinements) const {
    dd::Deformer deformer(mesh_, roles_, 1, {});
    std::vector<Folds> found;
    for (const dd::Refined& refined : refinements) {
      dd::UpdateOptions how;
      how.of_method.refined = refined;
      found.push_back(
          sorted({mesh_.positions + deformer.update(motion_.data(), how), mesh_.triangles}));
    }
    return found;
  }

  int by_smooth_arap() const {
    return sorted({dd::bench::deform_with_smooth_arap(mesh_, roles_, motion_).deformed,
                   mesh_.triangles})
        .count();
  }

 private:
  bool is_free(int triangle) const {
    const auto t = mesh_.triangles.row(triangle);
    return std::any_of(t.begin(), t.end(), [&](int v) { return roles_[v] == dd::kFree; });
  }

  void find_rims() {
    std::vector<char> rims(roles_.size(), 0);
    double area = 0;
    for (int j = 0; j < mesh_.triangle_count(); ++j) {
      if (!is_free(j)) continue;
      const auto t = mesh_.triangles.row(j);
      for (int v : t) rims[v] |= roles_[v] != dd::kFree;
      const Eigen::RowVector3d a = mesh_.positions.row(t[0]);
      area += 0.5 * (mesh_.positions.row(t[1]) - a).cross(mesh_.positions.row(t[2]) - a).norm();
    }
    size_ = std::sqrt(area);
    from_rims_ = dd::geodesic_distances(mesh_, rims);
  }

  Folds sorted(const Mesh& deformed) const {
    Folds folds;
    for (const auto& pair : dd::intersecting_pairs(deformed)) {
      if (at_rest_.count(pair) > 0 || !(is_free(pair.first) || is_free(pair.second))) continue;
      const int a = mesh_.triangles(pair.first, 0), b = mesh_.triangles(pair.second, 0);
      std::vector<char> source(roles_.size(), 0);
      source[a] = 1;
      if (dd::geodesic_distances(mesh_, source)[b] > 0.3 * size_)
        ++folds.between_parts;
      else
        ++(std::min(from_rims_[a], from_rims_[b]) < 0.06 * size_ ? folds.at_rims : folds.inside);
    }
    return folds;
  }

  const Mesh& mesh_;
  std::vector<int> roles_;
  dd::test::Affine motion_;
  std::set<std::pair<int, int>> at_rest_;
  std::vector<double> from_rims_;
  double size_ = 0;  // √ of the area of triangles with a free vertex
};

}  // namespace

int main(int count, char** arguments) {
  int poses = 0, worse = 0, better = 0, linear = 0, refined = 0, peer = 0, peer_worse = 0;
  int all_solid = 0, more_solid = 0, fewer_solid = 0;
  const auto take = [&](const std::string& name, const Mesh& mesh) {
    std::printf("%s: %d vertices\n", name.c_str(), mesh.vertex_count());
    for (int axis = 0; axis < 3; ++axis)
      for (const bool last : {false, true}) {
        const Limb limb(mesh, axis, last);
        const std::vector<Folds> found =
            limb.folds({{0, 0.009, 0.05, 0}, {4, 0.009, 0.05, 0}, {4, 0.009, 0.05, 1}});
        const int before = found[0].count(), now = found[1].count(), solid = found[2].count(),
                  smooth = limb.by_smooth_arap();
        ++poses;
        worse += now > before;
        better += now < before;
        linear += before;
        refined += now;
        peer += smooth;
        peer_worse += smooth > before;
        all_solid += solid;
        more_solid += solid > now;
        fewer_solid += solid < now;
        if (before + now + solid + smooth == 0) continue;
        std::printf(
            "  %c%c: %4d new pairs, Smooth ARAP %4d, refined %4d: %d at rims, %d between parts, %d "
            "else%s; solid %4d%s\n",
            last ? '+' : '-', "xyz"[axis], before, smooth, now, found[1].at_rims,
            found[1].between_parts, found[1].inside, now > before ? "  *" : "", solid,
            solid > now ? "  *" : "");
        std::fflush(stdout);
      }
  };
  try {
    for (int i = 1; i < count; ++i) take(arguments[i], dd::bench::mesh_from_file(arguments[i]));
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  std::printf("%d poses, %d new pairs, refined %d: %d with more, %d with fewer\n", poses, linear,
              refined, worse, better);
  std::printf("solid %d: %d with more than refined, %d with fewer\n", all_solid, more_solid,
              fewer_solid);
  std::printf("Smooth ARAP %d: %d with more\n", peer, peer_worse);
  return 0;
}
