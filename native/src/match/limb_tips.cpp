// SPDX-License-Identifier: GPL-3.0-or-later
#include "match/limb_tips.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "mesh/geodesic_distances.h"

namespace dd {

namespace {

// Samples that mean distances are taken to: one fast marching each.
constexpr size_t kDistanceSamples = 30;
// Least distance between tips, and of a tip from a marker, as a fraction of the largest distance.
constexpr double kMinTipDistance = 0.08;
// Least ratio of a tip's mean distance to that of the innermost vertex.
constexpr double kMinTipRatio = 1.25;
constexpr size_t kMaxTips = 8;  // bounds the search for the best pairing: at most 8! of them
// From more markers on, these constrain a fit better than tips; each costs a fast marching, too.
constexpr size_t kMaxMarked = 40;
// Fewest points that tell left from right: three are coplanar.
constexpr int kMinPairedPoints = 4;
// Added to distances before logarithms are taken, as a fraction of the largest one: bounds the cost
// of points that coincide on one shape only.
constexpr double kLogOffset = 0.05;

std::vector<double> distances_over(const Mesh& mesh, int vertex,
                                   double farthest = std::numeric_limits<double>::infinity()) {
  std::vector<char> source(static_cast<size_t>(mesh.vertex_count()), 0);
  source[size_t(vertex)] = 1;
  return geodesic_distances(mesh, source, farthest);
}

/// The points of a shape that are paired: its tips, then its marked vertices.
struct TipPoints {
  TipPoints(const CoarseShape& shape, const std::vector<int>& marked) : tip_count(0) {
    std::vector<std::vector<double>> marker_distances;
    marker_distances.reserve(marked.size());
    for (int v : marked) marker_distances.push_back(distances_over(shape.mesh, v));
    std::vector<int> tips = limb_tips(shape.mesh, shape.samples);
    double farthest = 0;
    for (const std::vector<double>& each : marker_distances)
      farthest = std::max(farthest, *std::max_element(each.begin(), each.end()));
    const auto is_marked = [&](int tip) {
      return std::any_of(marker_distances.begin(), marker_distances.end(),
                         [&](const std::vector<double>& each) {
                           return each[size_t(tip)] < kMinTipDistance * farthest;
                         });
    };
    tips.erase(std::remove_if(tips.begin(), tips.end(), is_marked), tips.end());
    tip_count = static_cast<int>(tips.size());
    vertices = std::move(tips);
    vertices.insert(vertices.end(), marked.begin(), marked.end());
    const Index all = static_cast<Index>(vertices.size());
    positions = rows_of(shape.mesh.positions, vertices, vertices.size());
    log_distances.resize(all, all);
    for (Index i = 0; i < all; ++i) {
      const std::vector<double> from = i < tip_count
                                           ? distances_over(shape.mesh, vertices[size_t(i)])
                                           : marker_distances[size_t(i - tip_count)];
      for (Index j = 0; j < all; ++j) log_distances(i, j) = from[size_t(vertices[size_t(j)])];
    }
    // Differences of logarithms compare ratios, so that longer limbs cost little.
    if (all > 0)
      log_distances = (log_distances.array() / log_distances.maxCoeff() + kLogOffset).log();
  }

  std::vector<int> vertices;
  int tip_count;
  Positions positions;
  Eigen::MatrixXd log_distances;
};

/// Branch and bound over all pairings of each tip of one shape with another one of the other.
class TipPairing {
 public:
  TipPairing(const TipPoints& few, const TipPoints& many, const Positions& placed_few,
             const Positions& placed_many)
      : few_(few), many_(many), placed_few_(placed_few), placed_many_(placed_many) {
    const int marked = static_cast<int>(few.vertices.size()) - few.tip_count;
    for (int k = 0; k < marked; ++k) chosen_.push_back({few.tip_count + k, many.tip_count + k});
    is_paired_.assign(static_cast<size_t>(many.tip_count), 0);
    double sum = 0;
    for (size_t k = 0; k < chosen_.size(); ++k) sum += difference(chosen_[k], k);
    const size_t all = few.vertices.size();
    pairs_ = static_cast<double>(all * (all - 1)) / 2;
    choose(0, sum, 0);
  }

  const Pairs& best() const { return best_; }

 private:
  /// The sum of the first cost term over a pair and each of the first chosen pairs.
  double difference(const std::array<int, 2>& pair, size_t first) const {
    double sum = 0;
    for (size_t k = 0; k < first; ++k)
      sum += std::abs(few_.log_distances(pair[0], chosen_[k][0]) -
                      many_.log_distances(pair[1], chosen_[k][1]));
    return sum;
  }

  void choose(int tip, double difference_so_far, double distance_so_far) {
    const double cost = difference_so_far / pairs_ + distance_so_far / few_.tip_count;
    if (cost >= least_cost_) return;
    if (tip == few_.tip_count) {
      const double whole = cost + similarity_residual();
      if (whole >= least_cost_) return;
      least_cost_ = whole;
      best_ = chosen_;
      return;
    }
    for (int other = 0; other < many_.tip_count; ++other) {
      if (is_paired_[size_t(other)]) continue;
      const std::array<int, 2> pair = {tip, other};
      const double more = difference(pair, chosen_.size());
      const double distance = (placed_few_.row(tip) - placed_many_.row(other)).norm();
      is_paired_[size_t(other)] = 1;
      chosen_.push_back(pair);
      choose(tip + 1, difference_so_far + more, distance_so_far + distance);
      chosen_.pop_back();
      is_paired_[size_t(other)] = 0;
    }
  }

  /// The mean residual of the similarity that fits the chosen pairs best.
  double similarity_residual() const {
    const Index count = static_cast<Index>(chosen_.size());
    Positions from(count, 3), to(count, 3);
    for (Index k = 0; k < count; ++k) {
      from.row(k) = few_.positions.row(chosen_[size_t(k)][0]);
      to.row(k) = many_.positions.row(chosen_[size_t(k)][1]);
    }
    const Similarity fit = fitted_similarity(from, to, Eigen::VectorXd::Ones(count));
    return (fit.all(from) - to).rowwise().norm().mean();
  }

  const TipPoints &few_, &many_;
  const Positions &placed_few_, &placed_many_;
  Pairs chosen_, best_;
  std::vector<char> is_paired_;
  double pairs_ = 0, least_cost_ = 1e300;
};

}  // namespace

std::vector<int> limb_tips(const Mesh& mesh, const std::vector<int>& samples) {
  const size_t count = std::min(kDistanceSamples, samples.size());
  std::vector<double> sum(static_cast<size_t>(mesh.vertex_count()), 0.0);
  double farthest = 0;
  for (size_t k = 0; k < count; ++k) {
    const std::vector<double> from = distances_over(mesh, samples[k]);
    for (size_t v = 0; v < sum.size(); ++v) sum[v] += from[v];
    farthest = std::max(farthest, *std::max_element(from.begin(), from.end()));
  }
  std::vector<int> order(sum.size());
  for (size_t v = 0; v < order.size(); ++v) order[v] = static_cast<int>(v);
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return sum[size_t(a)] > sum[size_t(b)]; });
  // By descending sum: a vertex close to one with a larger sum is no tip.
  std::vector<char> excluded(sum.size(), 0);
  std::vector<int> tips;
  for (int v : order) {
    if (tips.size() == kMaxTips || sum[size_t(v)] < kMinTipRatio * sum[size_t(order.back())]) break;
    if (excluded[size_t(v)]) continue;
    const std::vector<double> nearby = distances_over(mesh, v, kMinTipDistance * farthest);
    bool highest = true;
    for (size_t w = 0; w < sum.size(); ++w) {
      if (!(nearby[w] < kMinTipDistance * farthest)) continue;
      highest &= sum[w] <= sum[size_t(v)];
      if (sum[w] <= sum[size_t(v)]) excluded[w] = 1;
    }
    if (highest) tips.push_back(v);
  }
  return tips;
}

Pairs paired_tips(const CoarseShape& source, const CoarseShape& target, const Similarity& placement,
                  const Pairs& marked) {
  if (marked.size() > kMaxMarked) return {};
  std::vector<int> marks[2];
  for (const auto& pair : marked)
    for (int side = 0; side < 2; ++side) marks[side].push_back(pair[size_t(side)]);
  const TipPoints points[2] = {TipPoints(source, marks[0]), TipPoints(target, marks[1])};
  const int few = points[0].tip_count <= points[1].tip_count ? 0 : 1;
  if (points[few].tip_count == 0 || points[few].positions.rows() < kMinPairedPoints) return {};
  const Positions placed[2] = {placement.all(points[0].positions), points[1].positions};
  const TipPairing pairing(points[few], points[1 - few], placed[few], placed[1 - few]);
  Pairs result;
  for (const std::array<int, 2>& pair : pairing.best()) {
    if (pair[0] >= points[few].tip_count) continue;  // marked
    std::array<int, 2> found;
    found[size_t(few)] = points[few].vertices[size_t(pair[0])];
    found[size_t(1 - few)] = points[1 - few].vertices[size_t(pair[1])];
    result.push_back(found);
  }
  return result;
}

}  // namespace dd
