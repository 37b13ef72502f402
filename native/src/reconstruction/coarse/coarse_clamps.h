// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "reconstruction/coarse/coarse_surface.h"
#include "reconstruction/rim_clamps.h"
#include "systems/clamped_poisson.h"

namespace dd {

/// RimClamps of large surfaces, for which the factor of L + L W L would take more memory than that
/// of L and a second as long to make.
///
/// The clamped solution is that of (14) and a displacement δ that follows from the mismatch at rims
/// C alone, s = div(S) − L p' there:
///
///   (L + L W L) δ = L_:C W s
///
/// δ varies over the clamps' length, and is as smooth as a plate. So it is solved for on a coarse
/// surface that has all rim vertices and whose spacing grows slowly away from them. Areas and
/// distances are those of the fine surface, with its relief. Between the coarse
/// vertices k δ is interpolated with continuous slopes up to the square of the spacing (James
/// 2020, as BaseProxy does), G_k the mean gradient around vertex k:
///
///   δ(x) = Σ λ_k (δ_k + ½ G_k (x − x_k)).
class CoarseClamps : public RimClamps {
 public:
  /// Null where the coarse surface would not be small, or lacks too much of the relief. fine must
  /// outlive the result.
  static std::unique_ptr<CoarseClamps> make(FactoredSurface& fine, double length);

  void solve(const FluxSource& source, double weight, Rows& offsets) override;
  /// The same as solve() with weight 1.
  void step(const FluxSource& source, Rows& offsets) override { solve(source, 1, offsets); }
  double length() const override { return clamped_.length(); }
  double bytes() const override;

 private:
  /// squares: a of ClampedPoisson, of the coarse vertices on the fine surface.
  CoarseClamps(FactoredSurface& fine, std::unique_ptr<CoarseSurface> coarse, double length,
               const Eigen::VectorXd& squares);
  /// Sets nodes_ from the displacements of the coarse surface.
  void take_nodes();

  FactoredSurface& fine_;
  std::unique_ptr<CoarseSurface> coarse_;
  ClampedPoisson clamped_;                             // of the coarse surface
  Eigen::SparseMatrix<double, Eigen::RowMajor> rims_;  // L of the fine rims
  std::vector<int> fine_rim_;                          // of each rim of the coarse surface
  /// Of a free vertex of the fine surface: active indices of the coarse one, barycentric weights.
  struct Stencil {
    std::array<int, 3> node;
    std::array<float, 3> weight;
  };
  std::vector<Stencil> stencils_;
  // The mean gradients around its vertices, by active index and axis: 3·active × active.
  Eigen::SparseMatrix<double, Eigen::RowMajor> gradients_;
  /// δ_k − ½ G_k x_k, then the columns of ½ G_k.
  using Node = Eigen::Array<float, 4, 4>;
  std::vector<Node> nodes_;
  Rows mismatch_, coarse_mismatch_, displacement_;
};

}  // namespace dd
