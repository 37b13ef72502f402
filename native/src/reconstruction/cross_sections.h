// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "reconstruction/sampled_sections.h"

namespace dd {

/// Beyond the paper: (14) takes a surface for a hollow skin, which buckles where a limb is bent and
/// thins where it is twisted. Where a vertex p has another side of the surface behind it, it gets
/// an arm r to the centre c of its cross-section,
///
///   p = c + r.
///
/// A Refinement then reconstructs the centres from their rotated gradients, and turns arms rigidly,
///
///   L c' = div(R ∇c),   p' = c' + R r,
///
/// which is a rod whose sections keep their shape as far as R is constant over each of them (a
/// Cosserat rod), by the same factor. So R is averaged over sections first. At rest, for rigid
/// motions, and where no other side is near, with r = 0, nothing changes.
///
/// A section is sampled by rays from p into the inside, in the plane across the limb. c is the mean
/// of the points that they meet and p, averaged again over the sections of these; on a circle rays
/// alone would give its centre. It counts as far as it is thin beside the free length of the limb,
/// see free_lengths(), so that a slab of a body or a patch on one side of it stays a skin.
struct CrossSections {
  /// Active indices of the surface and weights.
  using Terms = std::vector<std::pair<int, double>>;

  /// By active index. Terms of the mean over its section, which sum to 1; of a vertex without
  /// another side: itself.
  std::vector<Terms> means;
  Positions arms;          ///< r
  Positions axes;          ///< unit vectors along the limb
  Eigen::VectorXd shares;  ///< how much of its section is there, in [0, 1]

  /// Averages values, rows by active index, over sections, all rounds. count: of the first ones;
  /// the others are read only.
  template <class Values>
  void average(Values& values, Index count) const;
  /// Whether no vertex has another side.
  bool empty() const { return !(shares.array() > 0).any(); }
  double bytes() const;
};

std::unique_ptr<CrossSections> find_cross_sections(const CrossSectionSamples& samples);
/// Those of all active vertices.
std::unique_ptr<CrossSections> find_cross_sections(const FactoredSurface& surface);

/// Rounds of averaging over sections. On a circle, a round leaves a third of the first angular mode
/// and half of the second.
constexpr int kCrossSectionRounds = 3;

template <class Values>
void CrossSections::average(Values& values, Index count) const {
  for (int round = 0; round < kCrossSectionRounds; ++round) {
    const Values before = values;
    for (Index i = 0; i < count; ++i) {
      values.row(i).setZero();
      for (const auto& [index, weight] : means[size_t(i)])
        values.row(i) += weight * before.row(index);
    }
  }
}

}  // namespace dd
