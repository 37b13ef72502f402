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
constexpr double kFlattest = 1e-9;
// Relative difference up to which a queued weight is still the edge's. Safety: allows for rounding.
constexpr double kSame = 1e-12;
// Least value of 16 area² / (Σ edge²)² for which the fast cotangent is used. Safety: the rounding
// error of a thinner triangle could decide.
constexpr double kSound = 1e-6;
// Fraction of the threshold; an edge is left out if its fast cotangents sum to more. Safety: a
// margin for their rounding.
constexpr double kSurely = 0.9;
// Flips per triangle, on average. Safety: the loop ends whatever rounding does.
constexpr int kMostFlips = 20;

/// Half-edges, numbered 3 × triangle + k from corner k to the next, and the half-edges they are
/// glued to.
class Gluing {
 public:
  explicit Gluing(const Triangles& t);

  int other(int side) const { return other_[side]; }
  /// Whether a half-edge and its twin have the same direction: their triangles are wound
  /// inconsistently.
  bool same_direction(int side) const { return same_direction_[side] != 0; }
  void glue(int side, int other, bool same_direction);

 private:
  std::vector<int> other_;  // twin of each; -1: border or non-manifold edge
  std::vector<char> same_direction_;
};

Gluing::Gluing(const Triangles& t)
    : other_(static_cast<size_t>(t.size()), -1), same_direction_(other_.size(), 0) {
  const Edges edges(t);
  for (int edge = 0; edge < edges.count(); ++edge) {
    const Edges::Range sides = edges.of(edge);
    if (sides.size() != 2) continue;
    const int a = sides.first->number, b = sides.last[-1].number;
    glue(a, b, t.data()[a] == t.data()[b]);
  }
}

void Gluing::glue(int side, int other, bool same_direction) {
  other_[side] = other;
  same_direction_[side] = same_direction;
  if (other < 0) return;
  other_[other] = side;
  same_direction_[other] = same_direction;
}

int next_side(int side) { return side % 3 == 2 ? side - 2 : side + 1; }

class Flipper {
 public:
  explicit Flipper(IntrinsicTriangles& result)
      : t_(result.triangles), lengths_(result.lengths), result_(result), sides_(t_) {}

  void run(double obtuse) {
    obtuse_ = obtuse;
    const std::vector<double> cotangents = corner_cotangents();
    for (int side = 0; side < t_.size(); ++side) {
      const int other = sides_.other(side);
      if (side < other && !(cotangents[side] + cotangents[other] > kSurely * obtuse))
        consider(side);
    }
    const int64_t most = int64_t{kMostFlips} * t_.rows();
    while (!queue_.empty() && result_.flips < most) {
      const auto [weight, side] = queue_.top();
      queue_.pop();
      // Skips entries whose weight has changed since: those edges were considered again.
      if (sides_.other(side) >= 0 && std::abs(weight - weight_of(side)) < kSame * std::abs(weight))
        flip(side, weight);
    }
  }

 private:
  double& length(int side) { return lengths_(side / 3, (side + 2) % 3); }
  double length(int side) const { return lengths_(side / 3, (side + 2) % 3); }
  int& from(int side) { return t_(side / 3, side % 3); }

  /// The cotangent opposite to each half-edge, from squared lengths; NaN for triangles so thin that
  /// rounding could decide.
  std::vector<double> corner_cotangents() const {
    std::vector<double> result(static_cast<size_t>(t_.size()));
    for (Index j = 0; j < t_.rows(); ++j) {
      const Eigen::RowVector3d squares = lengths_.row(j).cwiseAbs2();  // opposite to corners
      const double sum = squares.sum();
      const double sixteenth = sum * sum - 2 * squares.squaredNorm();  // 16 area²
      const bool sound = sixteenth > kSound * sum * sum;
      const double by_area =
          sound ? 1 / std::sqrt(sixteenth) : std::numeric_limits<double>::quiet_NaN();
      for (int k = 0; k < 3; ++k)
        result[static_cast<size_t>(3 * j + (k + 1) % 3)] = (sum - 2 * squares[k]) * by_area;
    }
    return result;
  }

  /// As triangle_apex(), with a height of at least kFlattest times the longest edge.
  static TriangleApex apex(double base, double to_first, double to_last) {
    const double longest = std::max({base, to_first, to_last});
    if (!(base > kFlattest * longest)) return {0, longest};
    TriangleApex result = triangle_apex(base, to_first, to_last);
    result.height = std::max(result.height, kFlattest * longest);
    return result;
  }
  TriangleApex apex_over(int side) const {
    const int next = next_side(side);
    return apex(length(side), length(next_side(next)), length(next));
  }

  /// The cotangent of the angle at the apex over a base.
  static double cotangent(double base, const TriangleApex& apex) {
    return base > 0 ? apex.height / base - apex.foot / base * ((base - apex.foot) / apex.height)
                    : 0;
  }
  /// The sum of the cotangents of both angles opposite to an edge.
  double weight_of(int side) const {
    return cotangent(length(side), apex_over(side)) +
           cotangent(length(side), apex_over(sides_.other(side)));
  }

  void consider(int side) {
    const int other = sides_.other(side);
    if (other < 0 || side / 3 == other / 3) return;
    const double weight = weight_of(side);
    if (weight < obtuse_) queue_.push({weight, std::min(side, other)});
  }

  /// Reverses the winding of a triangle.
  void mirror(int triangle) {
    struct Side {
      int other;
      bool same_direction;
    } old[3];
    const int first = 3 * triangle, place[3] = {first, first + 2, first + 1};
    for (int k = 0; k < 3; ++k)
      old[k] = {sides_.other(first + k), sides_.same_direction(first + k)};
    for (int k = 0; k < 3; ++k) {
      const bool inside = old[k].other >= 0 && old[k].other / 3 == triangle;
      const int other = inside ? place[old[k].other - first] : old[k].other;
      sides_.glue(place[k], other, inside ? old[k].same_direction : !old[k].same_direction);
    }
    std::swap(t_(triangle, 0), t_(triangle, 1));
    std::swap(lengths_(triangle, 0), lengths_(triangle, 1));
  }

  /// Triangles a b c and b a d become c d b and d c a.
  void flip(int side, double weight) {
    if (sides_.same_direction(side)) mirror(sides_.other(side) / 3);
    const int ab = side, bc = next_side(ab), ca = next_side(bc);
    const int ba = sides_.other(side), ad = next_side(ba), db = next_side(ad);
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
      int other;
      bool same_direction;
    } outer[4];
    for (int k = 0; k < 4; ++k)
      outer[k] = {length(old[k]), sides_.other(old[k]), sides_.same_direction(old[k])};
    from(ab) = vertex[2], from(bc) = vertex[3], from(ca) = vertex[1];
    from(ba) = vertex[3], from(ad) = vertex[2], from(db) = vertex[0];
    length(ab) = length(ba) = diagonal;
    for (int k = 0; k < 4; ++k) {
      length(now[k]) = outer[k].length;
      const int* glued = std::find(old, old + 4, outer[k].other);
      const int other = glued < old + 4 ? now[glued - old] : outer[k].other;
      sides_.glue(now[k], other, outer[k].same_direction);
    }
    result_.moved[ab / 3] = result_.moved[ba / 3] = 1;
    ++result_.flips;
    for (int outer_side : now) consider(outer_side);
  }

  struct Candidate {
    double weight;
    int side;
    bool operator<(const Candidate& other) const {  // the greatest is popped first: the most obtuse
      return weight > other.weight || (weight == other.weight && side > other.side);
    }
  };

  Triangles& t_;
  CornerValues& lengths_;
  IntrinsicTriangles& result_;
  Gluing sides_;
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
  result.moved.assign(static_cast<size_t>(t.rows()), 0);
  Flipper(result).run(obtuse);
  return result;
}

}  // namespace dd
