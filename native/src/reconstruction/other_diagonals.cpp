// SPDX-License-Identifier: GPL-3.0-or-later
#include "reconstruction/other_diagonals.h"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace dd {

namespace {

// Largest sum of the cotangents of the angles opposite to a diagonal without weight; of other edges
// of regular triangles it is about 1. Tuned: of tapered and flat limbs, whose quads are only nearly
// on circles, all count.
constexpr double kNoWeight = 0.05;

}  // namespace

OtherDiagonals other_diagonals(const Positions& positions, const SurfaceOperators& operators,
                               const std::vector<int>& active) {
  const Triangles& t = operators.triangles;
  struct Side {
    int low, high;  // the edge's ends
    int triangle, corner;
  };
  std::vector<Side> sides;
  sides.reserve(3 * active.size());
  for (int j : active)
    for (int k = 0; k < 3; ++k) {
      const int a = t(j, (k + 1) % 3), b = t(j, (k + 2) % 3);
      sides.push_back({std::min(a, b), std::max(a, b), j, k});
    }
  const auto edge = [](const Side& side) { return std::pair(side.low, side.high); };
  std::sort(sides.begin(), sides.end(), [&](const Side& a, const Side& b) {
    return std::tuple(edge(a), a.triangle) < std::tuple(edge(b), b.triangle);
  });
  std::vector<std::pair<double, size_t>> diagonals;  // weight, the first of the two sides
  for (size_t i = 0; i + 1 < sides.size();) {
    size_t end = i + 1;
    while (end < sides.size() && edge(sides[end]) == edge(sides[i])) ++end;
    if (end == i + 2) {
      const double weight =
          std::abs(operators.metric.cotangents(sides[i].triangle, sides[i].corner) +
                   operators.metric.cotangents(sides[i + 1].triangle, sides[i + 1].corner));
      if (weight < kNoWeight) diagonals.emplace_back(weight, i);
    }
    i = end;
  }
  std::sort(diagonals.begin(), diagonals.end());

  OtherDiagonals found;
  found.quad_of.assign(static_cast<size_t>(t.rows()), -1);
  std::vector<Eigen::RowVector3i> triangles;
  for (const auto& [weight, first] : diagonals) {
    const Side &one = sides[first], &other = sides[first + 1];
    int &quad_of_one = found.quad_of[size_t(one.triangle)],
        &quad_of_other = found.quad_of[size_t(other.triangle)];
    if (quad_of_one >= 0 || quad_of_other >= 0) continue;
    const int a = t(one.triangle, one.corner), b = t(one.triangle, (one.corner + 1) % 3),
              c = t(other.triangle, other.corner), d = t(one.triangle, (one.corner + 2) % 3);
    // A fold of a flat surface onto itself, or two triangles with the same corners.
    if (!((positions.row(a) - positions.row(c)).norm() > 0)) continue;
    quad_of_one = quad_of_other = static_cast<int>(triangles.size() / 2);
    triangles.emplace_back(a, b, c);
    triangles.emplace_back(a, c, d);
  }
  found.triangles.resize(Index(triangles.size()), 3);
  for (size_t i = 0; i < triangles.size(); ++i) found.triangles.row(Index(i)) = triangles[i];
  return found;
}

}  // namespace dd
