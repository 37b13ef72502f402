// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "base/handle_extension.h"
#include "reconstruction/factored_surface.h"
#include "support/progress.h"

namespace dd {

/// The geometry on which the energy that deforms the base is built.
enum class BaseMetric { surface = 0, base = 1 };

struct BindOptions {
  BaseMetric base_metric = BaseMetric::surface;
  double metric_smoothing = 0;  ///< mean edge lengths; with BaseMetric::surface only
  Smoothness smoothness = Smoothness::thin_plate;
  Triangulation triangulation = Triangulation::delaunay;
  /// B at rest from outside, n×3 in the mesh's units; empty: computed, as the others say.
  Positions base = {};
  /// Where that base has a topology of its own, its triangles; else none. See BaseProxy.
  Triangles base_triangles = {};
  /// Of what a frame works with; see PoissonSystem. Full is for comparisons.
  Precision precision = Precision::full;
  /// For the bind and every frame, the caller's among them; 0: what the machine has.
  int threads = 0;
  /// Poses of the same vertices, each n×3 in the mesh's units, for MethodKind::examples.
  std::vector<Positions> examples = {};
};

/// All that a bind makes once and the methods share.
struct BoundSurface : FactoredSurface {
  /// mesh: S, validated, in a box of about unit size, on which tolerances rely; so is a base given
  /// in the options. Throws Error; progress from 0 to 1.
  BoundSurface(Mesh mesh, const Region& region, const BindOptions& options, ThreadPool& pool,
               const Progress& progress);

  Positions base;  ///< B at rest, n×3
  HandleCoordinates coordinates;
  HandleExtension extension;  ///< of B
  /// Of S itself where that differs from B's: with BaseMetric::base.
  HandleExtension surface_extension;

  Rows rest_base;                   ///< B as rows in order()
  std::vector<Positions> examples;  ///< where S is, n×3

  /// Whether B comes from outside: then its motion does too, and there are no weights.
  bool outside_base() const { return extension.empty(); }
  double bytes() const;

 private:
  struct Energy;
  void compute_base(const BindOptions& options, BlockOptions block_options, Energy&& on_surface,
                    const Progress& progress);
};

}  // namespace dd
