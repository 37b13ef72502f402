// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/fill_reducing_order.h"

#include <Eigen/Eigenvalues>
#include <Eigen/OrderingMethods>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

namespace dd {

namespace {

constexpr int kMinPartToCut = 8;        // vertices of a part that is not cut further
constexpr int kMostBins = 256;          // candidate positions of a cut along a direction
constexpr double kLeastShare = 0.3;     // fraction of a part's vertices on each side of a cut
constexpr double kShortVariance = 0.2;  // short directions: at most this of the largest variance
// Costs of a cut over the square root of the part's size, 1 for a square grid. Up to
// kShortSeparator the search ends, which saves time at bind. From kGoodSeparator on short
// directions are tried, too, as meshes of thin triangles need.
constexpr double kShortSeparator = 0.9, kGoodSeparator = 1.5;
constexpr std::memory_order kRelaxed = std::memory_order_relaxed;
constexpr double kSameDirection = 0.99;  // cosine above which directions count as the same

/// A cut before a bin along a direction. Its separator is the set of vertices on one side that
/// have neighbours on the other. cost: their number, times up to 1.16 for unequal halves.
struct Cut {
  double cost = std::numeric_limits<double>::infinity();
  int bin = 0;
  bool separator_below = true;
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();
};

}  // namespace

class Bisector {
 public:
  Bisector(const SparseMatrix& graph, const Positions& positions, Dissection& result,
           ThreadPool* pool)
      : graph_(graph),
        positions_(positions),
        result_(result),
        order_(static_cast<size_t>(graph.cols())),
        at_(order_.size()) {
    std::iota(order_.begin(), order_.end(), 0);
    // The first levels one after the other, the parts of a level in parallel; then each part
    // recursively in a task of its own.
    std::vector<Part> parts{{0, static_cast<int>(order_.size()), 0}};
    for (int cuts = 0; cuts < kParallelLevels; ++cuts) {
      std::vector<int> middle(parts.size());
      run_tasks(pool, static_cast<int>(parts.size()),
                [&](int i) { middle[size_t(i)] = cut(parts[size_t(i)]); });
      std::vector<Part> halves;
      for (size_t i = 0; i < parts.size(); ++i) {
        const auto [begin, end, depth] = parts[i];
        halves.push_back({begin, middle[i], depth + 1});
        halves.push_back({middle[i], end, depth + 1});
      }
      parts = std::move(halves);
    }
    run_tasks(pool, static_cast<int>(parts.size()), [&](int i) { bisect(parts[size_t(i)]); });
  }

 private:
  static constexpr int kParallelLevels = 3;  // of cuts: 8 parts in parallel
  struct Part {
    int begin, end, depth;  // range of order_; number of cuts that led to it
  };
  struct Vertex {
    // Where its part begins in order_. Threads that cut other parts only read that it isn't theirs,
    // which a stale value tells as well: relaxed order is enough.
    std::atomic<int> part{0};
    int bin = 0;
  };

  void bisect(Part part) {
    const int middle = cut(part);
    if (middle == part.end) return;
    bisect({part.begin, middle, part.depth + 1});
    bisect({middle, part.end, part.depth + 1});
  }

  /// Cuts a part in two; returns where the upper half begins, or the part's end if it is not cut.
  int cut(Part part) {
    const auto [begin, end, depth] = part;
    if (end - begin <= kMinPartToCut || depth == Dissection::kMostCuts) return end;
    const Cut best = best_cut(begin, end);
    set_bins(begin, end, best.direction);
    const uint32_t bit = uint32_t{1} << depth;
    for (int i = begin; i < end; ++i) {
      const int v = order_[i];
      if (at_[v].bin >= best.bin) result_.sides_[v] |= bit;
      if (!best.separator_below) result_.separator_sides_[v] |= bit;
      ++result_.cut_count_[v];
    }
    const auto above = std::stable_partition(order_.begin() + begin, order_.begin() + end,
                                             [&](int v) { return at_[v].bin < best.bin; });
    const int middle = static_cast<int>(above - order_.begin());
    for (int i = middle; i < end; ++i) at_[order_[i]].part.store(middle, kRelaxed);
    return middle;
  }

  Cut best_cut(int begin, int end) {
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (int i = begin; i < end; ++i) mean += positions_.row(order_[i]).transpose();
    mean /= end - begin;
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
    for (int i = begin; i < end; ++i) {
      const Eigen::Vector3d x = positions_.row(order_[i]).transpose() - mean;
      spread += x * x.transpose();
    }
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes;
    axes.computeDirect(spread);
    const double narrow = kShortVariance * axes.eigenvalues()[2];
    Cut best;
    // Cuts across long directions first. Short ones are tried only if the best separator so far is
    // large nonetheless, as in meshes of thin triangles.
    const double root = std::sqrt(static_cast<double>(end - begin));
    for (const bool wide : {true, false}) {
      if (best.cost < kGoodSeparator * root) break;
      for (int k = 2; k >= 0; --k)
        if ((axes.eigenvalues()[k] > narrow) == wide && best.cost > kShortSeparator * root)
          consider(begin, end, axes.eigenvectors().col(k), best);
      // The coordinate axes, too, along which many meshes are modelled.
      for (int k = 0; k < 3; ++k)
        if ((spread(k, k) > narrow) == wide && best.cost > kShortSeparator * root &&
            axes.eigenvectors().row(k).cwiseAbs().maxCoeff() < kSameDirection)
          consider(begin, end, Eigen::Vector3d::Unit(k), best);
    }
    // No direction allows a cut, as positions coincide or form few clusters: halves by index.
    if (!(best.cost < std::numeric_limits<double>::infinity()))
      consider(begin, end, Eigen::Vector3d::Zero(), best);
    return best;
  }

  static int bin_count(int begin, int end) { return std::min(kMostBins, end - begin); }

  /// Sorts vertices into bins of equal width along a direction; by their order if it is zero.
  void set_bins(int begin, int end, const Eigen::Vector3d& direction) {
    const int bins = bin_count(begin, end);
    if (direction.isZero()) {
      for (int i = begin; i < end; ++i)
        at_[order_[i]].bin =
            static_cast<int>(static_cast<int64_t>(i - begin) * bins / (end - begin));
      return;
    }
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (int i = begin; i < end; ++i) {
      const double x = positions_.row(order_[i]).dot(direction);
      low = std::min(low, x);
      high = std::max(high, x);
    }
    // A little less than `bins`, so that the highest position falls into the last bin.
    const double scale = high > low ? (bins - 1e-6) / (high - low) : 0;
    for (int i = begin; i < end; ++i)
      at_[order_[i]].bin =
          static_cast<int>((positions_.row(order_[i]).dot(direction) - low) * scale);
  }

  void consider(int begin, int end, const Eigen::Vector3d& direction, Cut& best) {
    set_bins(begin, end, direction);
    const int bins = bin_count(begin, end);
    // For each cut the vertices below it, and those of either side with a neighbour across: as
    // differences from cut to cut, summed up below.
    int counts[kMostBins + 1], below[kMostBins + 1], above[kMostBins + 1];
    for (int* values : {counts, below, above}) std::fill_n(values, bins + 1, 0);
    const int *starts = graph_.outerIndexPtr(), *neighbours = graph_.innerIndexPtr();
    for (int i = begin; i < end; ++i) {
      const int v = order_[i], own = at_[v].bin;
      int lowest = own, highest = own;
      for (int k = starts[v]; k < starts[v + 1]; ++k) {
        const Vertex& other = at_[neighbours[k]];
        if (other.part.load(kRelaxed) != begin) continue;
        lowest = std::min(lowest, other.bin);
        highest = std::max(highest, other.bin);
      }
      ++counts[own + 1];
      ++below[own + 1], --below[highest + 1];
      ++above[lowest + 1], --above[own + 1];
    }
    const double size = end - begin;
    int under = 0, low_side = 0, high_side = 0;
    for (int cut = 1; cut < bins; ++cut) {
      under += counts[cut];
      low_side += below[cut];
      high_side += above[cut];
      const double share = under / size;
      if (share < kLeastShare || share > 1 - kLeastShare) continue;
      const double lean = 1 + 4 * (share - 0.5) * (share - 0.5);
      const double cost = lean * std::min(low_side, high_side);
      if (cost < best.cost) best = {cost, cut, low_side <= high_side, direction};
    }
  }

  const SparseMatrix& graph_;
  const Positions& positions_;
  Dissection& result_;
  std::vector<int> order_;
  std::vector<Vertex> at_;
};

Dissection::Dissection(const SparseMatrix& graph, const Positions& positions, ThreadPool* pool)
    : sides_(static_cast<size_t>(graph.cols()), 0),
      separator_sides_(sides_.size(), 0),
      cut_count_(sides_.size(), 0) {
  const Bisector bisector(graph, positions, *this, pool);
}

std::vector<int> Dissection::order(const SparseMatrix& pattern) const {
  // Sort keys of a digit for each cut: 0 below it, 1 above it, 2 in its separator.
  std::vector<std::pair<uint64_t, int>> keys;
  keys.reserve(sides_.size());
  const int *starts = pattern.outerIndexPtr(), *neighbours = pattern.innerIndexPtr();
  for (int v = 0; v < static_cast<int>(sides_.size()); ++v) {
    // The first cut with v and a neighbour on different sides has separated the two. Of these cuts
    // v is in the separator of the first whose separator is on v's side.
    uint32_t parted = 0;
    for (int k = starts[v]; k < starts[v + 1]; ++k) {
      const uint32_t differing = sides_[v] ^ sides_[neighbours[k]];
      parted |= differing & (~differing + 1);
    }
    parted &= ~(sides_[v] ^ separator_sides_[v]);
    uint64_t key = 0;
    for (int cut = 0; cut < kMostCuts; ++cut) {
      const bool in_separator = parted >> cut & 1;
      const uint64_t digit = in_separator ? 2 : cut < cut_count_[v] ? sides_[v] >> cut & 1 : 0;
      key |= digit << 2 * (kMostCuts - 1 - cut);
      if (in_separator) break;
    }
    keys.emplace_back(key, v);
  }
  std::sort(keys.begin(), keys.end());
  std::vector<int> result;
  result.reserve(keys.size());
  for (const auto& [key, v] : keys) result.push_back(v);
  return result;
}

std::vector<int> minimum_degree(const SparseMatrix& pattern) {
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> permutation;
  // AMDOrdering's template arguments are deduced from Eigen's own type only.
  Eigen::AMDOrdering<int>()(static_cast<const Eigen::SparseMatrix<double>&>(pattern), permutation);
  const int* order = permutation.indices().data();
  return {order, order + pattern.cols()};
}

}  // namespace dd
