// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mesh/point_grid.h"
#include "support/thread_pool.h"
#include "support/types.h"

namespace dd {

/// What closes in a pose: lids, lips, a fist. Of points x at rest and y in the pose, i and j of the
/// same loose part close by
///
///   c_ij = s(1 − b / reach) s(1 − 2 b / a) s(2 (a − b) / reach − 1),    s(t) = 3t² − 2t³,
///
/// with a and b their distances in x and y: not at all where they aren't near in the pose, or not
/// nearer by half than at rest, or by half of the reach; c_i is the largest. Continuous in the
/// pose, but where so many crowd that they can't all be looked at. Loose parts slide over one
/// another, as an eye does under its lids, which brings points together where no gap closes.
class Contacts {
 public:
  /// rest: x. parts: the number of each point's; -1: it doesn't take part. masses: of the points;
  /// where they are denser than a third of the reach, one takes the mass of all and stands for
  /// them. reach: in the unit of the points.
  Contacts(Positions rest, std::vector<int> parts, const Eigen::VectorXd& masses, double reach);

  /// Takes a pose, y. Returns whether anything closes.
  bool take(const Positions& posed, ThreadPool& pool);

  /// How points p are to be moved so that what closes is as near there, each side by half: for each
  /// point c_i e_i and c_i, times what it stands for in parts of its own mass,
  ///
  ///   e_i = ½ ((y_i − p_i) − mean_j (y_j − p_j)), weighted by c_ij;
  ///
  /// what is much farther than the reach isn't believed.
  Rows missing(const Positions& posed, const Positions& placed, ThreadPool& pool) const;

 private:
  struct Pair {
    int points[2];
    float share;  // c_ij
  };
  /// The chosen points in the box of those that move, and as far about it as they may close.
  std::vector<int> near_what_moves(const Positions& posed, ThreadPool& pool) const;
  /// Of the grid's points those that close, in ranges that are the same whatever the threads.
  std::vector<std::vector<Pair>> closing_pairs(const PointGrid& grid, ThreadPool& pool) const;

  struct Partner {
    int point;
    float share;  // c_ij
  };
  Positions rest_;
  std::vector<int> parts_, chosen_;
  std::vector<double> stands_for_;  // of each point; 0: another one stands for it
  double reach_;
  std::vector<size_t> begin_;  // of each point's partners
  std::vector<Partner> partners_;
};

}  // namespace dd
