// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mesh/point_grid.h"
#include "support/thread_pool.h"
#include "support/types.h"

namespace dd {

/// Gaps that close in a pose: lids, lips, a fist. With points x at rest and y in the pose, points i
/// and j of the same loose part close by
///
///   c_ij = s(1 − b / reach) s(1 − 2 b / a) s(2 (a − b) / reach − 1),    s(t) = 3t² − 2t³,
///
/// where a and b are their distances in x and y. So c_ij is 0 unless b < reach, b < a / 2, and b <
/// a − reach / 2. c_i is the largest c_ij. Continuous in the pose, except where points crowd and
/// only some pairs are examined. Points of different parts are left out: an eye slides under its
/// lids, which brings points together though no gap closes.
class Contacts {
 public:
  /// rest: x. parts: each point's loose part; -1: the point is left out. masses: of the points. In
  /// each cell as wide as a third of the reach, one point of each part represents the others, with
  /// their mass. reach: in the points' units.
  Contacts(Positions rest, std::vector<int> parts, const Eigen::VectorXd& masses, double reach);

  /// Takes a pose, y. Returns whether anything closes.
  bool find_closing(const Positions& posed, ThreadPool& pool);

  /// The displacements e of points p that bring closing points as near together as in the pose,
  /// each side by half. The row of point i is (c_i e_i, c_i) times the ratio of the mass that it
  /// represents to its own,
  ///
  ///   e_i = ½ ((y_i − p_i) − mean_j (y_j − p_j)), weighted by c_ij,
  ///
  /// and falls off where e_i is much longer than the reach. Zero for represented points.
  Rows closing_displacements(const Positions& posed, const Positions& placed,
                             ThreadPool& pool) const;

 private:
  struct ClosingPair {
    int points[2];
    float closeness;  // c_ij
  };
  /// The representatives within reach of the bounding box of those that move.
  std::vector<int> near_moving(const Positions& posed, ThreadPool& pool) const;
  /// The closing pairs of the grid's points, by ranges that don't depend on the number of threads.
  std::vector<std::vector<ClosingPair>> closing_pairs(const PointGrid& grid,
                                                      ThreadPool& pool) const;

  struct ClosingPartner {
    int point;
    float closeness;  // c_ij
  };
  Positions rest_;
  std::vector<int> parts_, representatives_;
  std::vector<double> mass_ratio_;  // mass that each represents over its own; 0: is represented
  double reach_;
  std::vector<size_t>
      partner_begin_;  // partners of point i: partner_begin_[i] to partner_begin_[i + 1]
  std::vector<ClosingPartner> partners_;
};

}  // namespace dd
