// SPDX-License-Identifier: GPL-3.0-or-later
#include "fill_reducing_order.h"

#include <Eigen/Eigenvalues>
#include <Eigen/OrderingMethods>
#include <algorithm>
#include <limits>
#include <numeric>

namespace dd {

namespace {

constexpr int kSmallest = 8;         // parts that are not cut further
constexpr int kMostBins = 256;       // places of a cut along one direction
constexpr double kLeastShare = 0.3;  // of a part, on each side of a cut

/// A cut in front of bin `bin` along a direction; the separator is taken from one side.
struct Cut {
  double cost = std::numeric_limits<double>::infinity();
  int bin = 0;
  bool separator_below = true;
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();
};

class Dissection {
 public:
  Dissection(const SparseMatrix& pattern, const Positions& places)
      : pattern_(pattern),
        places_(places),
        order_(static_cast<size_t>(pattern.cols())),
        part_(order_.size(), 0),
        bin_(order_.size(), 0) {
    std::iota(order_.begin(), order_.end(), 0);
    dissect(0, static_cast<int>(order_.size()));
  }

  std::vector<int> take() { return std::move(order_); }

 private:
  static constexpr int kNone = -1;

  void dissect(int begin, int end) {
    // The larger half is done in the loop: recursion stays shallow whatever the graph.
    while (end - begin > kSmallest) {
      const int part = part_[order_[begin]];
      const Cut cut = best_cut(begin, end, part);
      const auto [below, above] = split(begin, end, part, cut);
      if (below == begin || above == below) return;  // a clique or nearly: no cut helps
      dissect(begin, below);
      begin = below;
      end = above;
    }
  }

  /// Sorts the range into what lies below the cut, above it, and the separator at the end. Returns
  /// the ends of the first two.
  std::pair<int, int> split(int begin, int end, int part, const Cut& cut) {
    set_bins(begin, end, cut.direction);
    const int first = next_part_++, second = next_part_++;
    for (int i = begin; i < end; ++i) {
      const int v = order_[i];
      const bool below = bin_[v] < cut.bin;
      int& label = part_[v];
      label = below ? first : second;
      if (below != cut.separator_below) continue;
      for (SparseMatrix::InnerIterator it(pattern_, v); it; ++it) {
        const int u = static_cast<int>(it.row());
        const int of = part_[u];
        if ((of == part || of == first || of == second) && (bin_[u] < cut.bin) != below) {
          label = kNone;
          break;
        }
      }
    }
    const auto start = order_.begin();
    const auto middle = std::stable_partition(start + begin, start + end,
                                              [&](int v) { return part_[v] == first; });
    const auto last =
        std::stable_partition(middle, start + end, [&](int v) { return part_[v] == second; });
    return {static_cast<int>(middle - start), static_cast<int>(last - start)};
  }

  Cut best_cut(int begin, int end, int part) {
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (int i = begin; i < end; ++i) mean += places_.row(order_[i]).transpose();
    mean /= end - begin;
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
    for (int i = begin; i < end; ++i) {
      const Eigen::Vector3d x = places_.row(order_[i]).transpose() - mean;
      spread += x * x.transpose();
    }
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes;
    axes.computeDirect(spread);
    Cut best;
    const double longest = axes.eigenvalues()[2];
    for (int k = 2; k >= 0; --k)
      if (axes.eigenvalues()[k] > 0.2 * longest) consider(begin, end, part, axes.eigenvectors().col(k), best);
    for (int k = 0; k < 3; ++k)
      if (spread(k, k) > 0.2 * longest) consider(begin, end, part, Eigen::Vector3d::Unit(k), best);
    // All in one place, or a few large steps: by number, in halves.
    if (!(best.cost < std::numeric_limits<double>::infinity()))
      consider(begin, end, part, Eigen::Vector3d::Zero(), best);
    return best;
  }

  /// Bins of equal width along a direction; in the order at hand where it is zero.
  void set_bins(int begin, int end, const Eigen::Vector3d& direction) {
    const int bins = bin_count(begin, end);
    if (direction.isZero()) {
      for (int i = begin; i < end; ++i)
        bin_[order_[i]] = static_cast<int>(static_cast<int64_t>(i - begin) * bins / (end - begin));
      return;
    }
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (int i = begin; i < end; ++i) {
      const double x = places_.row(order_[i]).dot(direction);
      low = std::min(low, x);
      high = std::max(high, x);
    }
    const double scale = high > low ? (bins - 1e-6) / (high - low) : 0;
    for (int i = begin; i < end; ++i)
      bin_[order_[i]] =
          static_cast<int>((places_.row(order_[i]).dot(direction) - low) * scale);
  }

  static int bin_count(int begin, int end) { return std::min(kMostBins, end - begin); }

  void consider(int begin, int end, int part, const Eigen::Vector3d& direction, Cut& best) {
    set_bins(begin, end, direction);
    // How many vertices lie below a cut, and how many of either side have a neighbour across.
    const int bins = bin_count(begin, end);
    int counts[kMostBins + 1], below[kMostBins + 1], above[kMostBins + 1];
    for (int* values : {counts, below, above}) std::fill_n(values, bins + 1, 0);
    for (int i = begin; i < end; ++i) {
      const int v = order_[i], own = bin_[v];
      int lowest = own, highest = own;
      for (SparseMatrix::InnerIterator it(pattern_, v); it; ++it) {
        const int u = static_cast<int>(it.row());
        if (part_[u] != part) continue;
        lowest = std::min(lowest, bin_[u]);
        highest = std::max(highest, bin_[u]);
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

  const SparseMatrix& pattern_;
  const Positions& places_;
  std::vector<int> order_;
  std::vector<int> part_;  // of each vertex: the part that it is in
  std::vector<int> bin_;
  int next_part_ = 1;
};

}  // namespace

std::vector<int> nested_dissection(const SparseMatrix& pattern, const Positions& places) {
  return Dissection(pattern, places).take();
}

std::vector<int> minimum_degree(const SparseMatrix& pattern) {
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> permutation;
  Eigen::AMDOrdering<int>()(pattern, permutation);
  const int* order = permutation.indices().data();
  return {order, order + pattern.cols()};
}

}  // namespace dd
