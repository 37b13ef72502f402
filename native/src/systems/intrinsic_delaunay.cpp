// SPDX-License-Identifier: GPL-3.0-or-later
#include "systems/intrinsic_delaunay.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <queue>
#include <utility>

#include "mesh/topology.h"

namespace dd {

namespace {

// Least height as a fraction of the longest edge. Safety: keeps cotangents of triangles without
// area finite.
constexpr double kMinHeight = 1e-9;
// Relative difference up to which a queued weight is still the edge's. Safety: allows for rounding.
constexpr double kSameWeight = 1e-12;
// Least value of 16 area² / (Σ edge²)² for which the fast cotangent is used. Safety: the rounding
// error of a thinner triangle could decide.
constexpr double kMinFastArea = 1e-6;
// An edge whose fast cotangents sum to more than this fraction of the (negative) threshold is no
// candidate. Safety: a margin for their rounding.
constexpr double kFastSumMargin = 0.9;
// Flips per triangle, on average. Safety: the loop ends whatever rounding does.
constexpr int kMostFlips = 20;

/// Half-edges, numbered 3 × triangle + k from corner k to the next, and their twins, the half-edges
/// of the neighbouring triangles along the same edges.
class HalfEdgeTwins {
 public:
  explicit HalfEdgeTwins(const Triangles& t);

  int twin(int half_edge) const { return twin_[half_edge]; }
  /// Whether a half-edge and its twin have the same direction: their triangles are wound
  /// inconsistently.
  bool same_direction(int half_edge) const { return same_direction_[half_edge] != 0; }
  void link(int half_edge, int twin, bool same_direction);

 private:
  std::vector<int> twin_;  // -1: border or non-manifold edge
  std::vector<char> same_direction_;
};

HalfEdgeTwins::HalfEdgeTwins(const Triangles& t)
    : twin_(static_cast<size_t>(t.size()), -1), same_direction_(twin_.size(), 0) {
  const Edges edges(t);
  for (int edge = 0; edge < edges.count(); ++edge) {
    const Edges::Range sides = edges.of(edge);
    if (sides.size() != 2) continue;
    const int a = sides.first->number, b = sides.last[-1].number;
    link(a, b, t.data()[a] == t.data()[b]);
  }
}

void HalfEdgeTwins::link(int half_edge, int twin, bool same_direction) {
  twin_[half_edge] = twin;
  same_direction_[half_edge] = same_direction;
  if (twin < 0) return;
  twin_[twin] = half_edge;
  same_direction_[twin] = same_direction;
}

int next_half_edge(int half_edge) { return half_edge % 3 == 2 ? half_edge - 2 : half_edge + 1; }

class Flipper {
 public:
  explicit Flipper(IntrinsicTriangles& result)
      : t_(result.triangles), lengths_(result.lengths), result_(result), twins_(t_) {}

  void run(double obtuse) {
    obtuse_ = obtuse;
    const std::vector<double> cotangents = corner_cotangents();
    for (int half_edge = 0; half_edge < t_.size(); ++half_edge) {
      const int twin = twins_.twin(half_edge);
      if (half_edge < twin && !(cotangents[half_edge] + cotangents[twin] > kFastSumMargin * obtuse))
        consider(half_edge);
    }
    const int64_t most = int64_t{kMostFlips} * t_.rows();
    while (!queue_.empty() && result_.flips < most) {
      const auto [weight, half_edge] = queue_.top();
      queue_.pop();
      // Skips entries whose weight has changed since: those edges were considered again.
      if (twins_.twin(half_edge) >= 0 &&
          std::abs(weight - weight_of(half_edge)) < kSameWeight * std::abs(weight))
        flip(half_edge, weight);
    }
  }

 private:
  double& length(int half_edge) { return lengths_(half_edge / 3, (half_edge + 2) % 3); }
  double length(int half_edge) const { return lengths_(half_edge / 3, (half_edge + 2) % 3); }
  int& from(int half_edge) { return t_(half_edge / 3, half_edge % 3); }

  /// The cotangent opposite to each half-edge, from squared lengths; NaN for triangles so thin that
  /// rounding could decide.
  std::vector<double> corner_cotangents() const {
    std::vector<double> result(static_cast<size_t>(t_.size()));
    for (Index j = 0; j < t_.rows(); ++j) {
      const Eigen::RowVector3d squares = lengths_.row(j).cwiseAbs2();  // opposite to corners
      const double sum = squares.sum();
      const double sixteenth = sum * sum - 2 * squares.squaredNorm();  // 16 area²
      const bool thick_enough = sixteenth > kMinFastArea * sum * sum;
      const double by_area =
          thick_enough ? 1 / std::sqrt(sixteenth) : std::numeric_limits<double>::quiet_NaN();
      for (int k = 0; k < 3; ++k)
        result[static_cast<size_t>(3 * j + (k + 1) % 3)] = (sum - 2 * squares[k]) * by_area;
    }
    return result;
  }

  /// As triangle_apex(), with a height of at least kMinHeight times the longest edge.
  static TriangleApex apex(double base, double to_first, double to_last) {
    const double longest = std::max({base, to_first, to_last});
    if (!(base > kMinHeight * longest)) return {0, longest};
    TriangleApex result = triangle_apex(base, to_first, to_last);
    result.height = std::max(result.height, kMinHeight * longest);
    return result;
  }
  TriangleApex apex_over(int half_edge) const {
    const int next = next_half_edge(half_edge);
    return apex(length(half_edge), length(next_half_edge(next)), length(next));
  }

  /// The cotangent of the angle at the apex over a base.
  static double cotangent(double base, const TriangleApex& apex) {
    return base > 0 ? apex.height / base - apex.foot / base * ((base - apex.foot) / apex.height)
                    : 0;
  }
  /// The sum of the cotangents of both angles opposite to an edge.
  double weight_of(int half_edge) const {
    return cotangent(length(half_edge), apex_over(half_edge)) +
           cotangent(length(half_edge), apex_over(twins_.twin(half_edge)));
  }

  void consider(int half_edge) {
    const int twin = twins_.twin(half_edge);
    if (twin < 0 || half_edge / 3 == twin / 3) return;
    const double weight = weight_of(half_edge);
    if (weight < obtuse_) queue_.push({weight, std::min(half_edge, twin)});
  }

  /// Reverses the winding of a triangle.
  void mirror(int triangle) {
    struct Link {
      int twin;
      bool same_direction;
    } old[3];
    const int first = 3 * triangle, mirrored[3] = {first, first + 2, first + 1};
    for (int k = 0; k < 3; ++k) old[k] = {twins_.twin(first + k), twins_.same_direction(first + k)};
    for (int k = 0; k < 3; ++k) {
      const bool inside = old[k].twin >= 0 && old[k].twin / 3 == triangle;
      const int twin = inside ? mirrored[old[k].twin - first] : old[k].twin;
      twins_.link(mirrored[k], twin, inside ? old[k].same_direction : !old[k].same_direction);
    }
    std::swap(t_(triangle, 0), t_(triangle, 1));
    std::swap(lengths_(triangle, 0), lengths_(triangle, 1));
  }

  /// Triangles a b c and b a d become c d b and d c a.
  void flip(int half_edge, double weight) {
    if (twins_.same_direction(half_edge)) mirror(twins_.twin(half_edge) / 3);
    const int ab = half_edge, bc = next_half_edge(ab), ca = next_half_edge(bc);
    const int ba = twins_.twin(half_edge), ad = next_half_edge(ba), db = next_half_edge(ad);
    const TriangleApex c = apex_over(ab), d = apex_over(ba);  // d's foot is measured from b
    const double along = length(ab) - d.foot - c.foot, across = c.height + d.height;
    const double diagonal = std::sqrt(along * along + across * across);
    const double after = cotangent(diagonal, apex(diagonal, length(bc), length(db))) +
                         cotangent(diagonal, apex(diagonal, length(ca), length(ad)));
    if (!(after > weight)) return;  // no gain: it was obtuse by rounding only
    const int vertex[] = {from(ab), from(ba), from(ca), from(db)};  // a b c d
    // The outer half-edges as they were, in the order of the new triangles (db bc, ca ad), and the
    // half-edges they become.
    const int old[4] = {db, bc, ca, ad}, now[4] = {bc, ca, ad, db};
    struct Outer {
      double length;
      int twin;
      bool same_direction;
    } outer[4];
    for (int k = 0; k < 4; ++k)
      outer[k] = {length(old[k]), twins_.twin(old[k]), twins_.same_direction(old[k])};
    from(ab) = vertex[2], from(bc) = vertex[3], from(ca) = vertex[1];
    from(ba) = vertex[3], from(ad) = vertex[2], from(db) = vertex[0];
    length(ab) = length(ba) = diagonal;
    for (int k = 0; k < 4; ++k) {
      length(now[k]) = outer[k].length;
      const int* glued = std::find(old, old + 4, outer[k].twin);
      const int twin = glued < old + 4 ? now[glued - old] : outer[k].twin;
      twins_.link(now[k], twin, outer[k].same_direction);
    }
    result_.flipped[ab / 3] = result_.flipped[ba / 3] = 1;
    ++result_.flips;
    for (int outer_half_edge : now) consider(outer_half_edge);
  }

  struct Candidate {
    double weight;
    int half_edge;
    bool operator<(const Candidate& other) const {  // the greatest is popped first: the most obtuse
      return weight > other.weight || (weight == other.weight && half_edge > other.half_edge);
    }
  };

  Triangles& t_;
  CornerValues& lengths_;
  IntrinsicTriangles& result_;
  HalfEdgeTwins twins_;
  std::priority_queue<Candidate> queue_;
  double obtuse_ = 0;
};

}  // namespace

TriangleApex triangle_apex(double base, double to_first, double to_last) {
  // Heron's formula as Kahan arranges it, which is accurate for needles.
  double a = base, b = to_first, c = to_last;
  if (a < b) std::swap(a, b);
  if (b < c) std::swap(b, c);
  if (a < b) std::swap(a, b);
  const double square = (a + (b + c)) * (c - (a - b)) * (c + (a - b)) * (a + (b - c));
  return {0.5 * (base + (to_first - to_last) * ((to_first + to_last) / base)),
          0.5 * std::sqrt(std::max(square, 0.0)) / base};
}

IntrinsicTriangles intrinsic_delaunay(const Positions& p, const Triangles& t, double obtuse) {
  IntrinsicTriangles result;
  result.triangles = t;
  result.lengths.resize(t.rows(), 3);
  for (Index j = 0; j < t.rows(); ++j)
    for (int k = 0; k < 3; ++k)
      result.lengths(j, k) = (p.row(t(j, (k + 2) % 3)) - p.row(t(j, (k + 1) % 3))).norm();
  result.flipped.assign(static_cast<size_t>(t.rows()), 0);
  Flipper(result).run(obtuse);
  return result;
}

}  // namespace dd
