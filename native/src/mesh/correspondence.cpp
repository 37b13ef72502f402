// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/correspondence.h"

#include <algorithm>
#include <string>
#include <utility>

#include "mesh/topology.h"
#include "support/error.h"

namespace dd {

namespace {

void check_range(const Pairs& pairs, int sources, int targets, const char* what) {
  if (pairs.empty())
    throw Error(Status::argument, std::string("There is no pair of corresponding ") + what,
                Remedy::match_meshes);
  const int count[2] = {sources, targets};
  for (size_t i = 0; i < pairs.size(); ++i)
    for (int side = 0; side < 2; ++side)
      if (pairs[i][side] < 0 || pairs[i][side] >= count[side])
        throw Error(Status::argument, {Subject::pair, Index(i)},
                    "names number " + std::to_string(pairs[i][side]) + " of the " +
                        (side == 0 ? "source" : "target") + ", which has " +
                        std::to_string(count[side]) + " " + what,
                    Remedy::call);
}

/// The pairs grouped by target, duplicates removed.
Correspondence by_target(Pairs pairs, int target_triangles) {
  for (auto& pair : pairs) std::swap(pair[0], pair[1]);
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  Correspondence result;
  result.begin.assign(static_cast<size_t>(target_triangles) + 1, 0);
  for (const auto& [target, source] : pairs) {
    ++result.begin[static_cast<size_t>(target) + 1];
    result.source.push_back(source);
  }
  for (size_t j = 0; j + 1 < result.begin.size(); ++j) result.begin[j + 1] += result.begin[j];
  return result;
}

}  // namespace

Correspondence triangle_correspondence(const Pairs& pairs, int source_triangles,
                                       int target_triangles) {
  check_range(pairs, source_triangles, target_triangles, "triangles");
  return by_target(pairs, target_triangles);
}

Correspondence vertex_correspondence(const Pairs& pairs, const Mesh& source, const Mesh& target) {
  validate(source, MeshOf::source);
  validate(target, MeshOf::target);
  check_range(pairs, source.vertex_count(), target.vertex_count(), "vertices");
  std::vector<std::vector<int>> partners(static_cast<size_t>(target.vertex_count()));
  for (const auto& [from, to] : pairs) partners[to].push_back(from);
  const VertexTriangles around(source.triangles, source.vertex_count());

  Pairs found;
  for (int j = 0; j < target.triangle_count(); ++j) {
    std::vector<int> touched;  // source triangles, once for each corner of j paired
    for (int k = 0; k < 3; ++k) {
      std::vector<int> of_corner;
      for (int partner : partners[target.triangles(j, k)])
        of_corner.insert(of_corner.end(), around.of(partner).begin(), around.of(partner).end());
      std::sort(of_corner.begin(), of_corner.end());
      touched.insert(touched.end(), of_corner.begin(),
                     std::unique(of_corner.begin(), of_corner.end()));
    }
    std::sort(touched.begin(), touched.end());
    Index most = 0;
    std::vector<int> best;
    for (auto it = touched.begin(); it != touched.end();) {
      const auto end = std::upper_bound(it, touched.end(), *it);
      if (end - it > most) best.clear();
      most = std::max<Index>(most, end - it);
      if (end - it == most) best.push_back(*it);
      it = end;
    }
    for (int from : best) found.push_back({from, j});
  }
  if (found.empty())
    throw Error(Status::argument, "None of the paired vertices belongs to a triangle on both sides",
                Remedy::match_meshes);
  return by_target(found, target.triangle_count());
}

Correspondence identity_correspondence(const Mesh& source, const Mesh& target) {
  if (source.vertex_count() != target.vertex_count() ||
      source.triangle_count() != target.triangle_count())
    throw Error(Status::argument,
                "The source has " + std::to_string(source.vertex_count()) + " vertices and " +
                    std::to_string(source.triangle_count()) + " triangles, the target " +
                    std::to_string(target.vertex_count()) + " and " +
                    std::to_string(target.triangle_count()) + ": they are not of the same topology",
                Remedy::match_meshes);
  if (source.triangles != target.triangles) {
    Index j = 0;
    while (source.triangles.row(j) == target.triangles.row(j)) ++j;
    throw Error(Status::argument, {Subject::target_triangle, j},
                "joins other vertices than in the source: they are not of the same topology",
                Remedy::match_meshes);
  }
  Correspondence result;
  for (int j = 0; j < target.triangle_count(); ++j) {
    result.begin.push_back(j);
    result.source.push_back(j);
  }
  result.begin.push_back(target.triangle_count());
  return result;
}

}  // namespace dd
