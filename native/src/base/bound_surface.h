// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "base/handle_extension.h"
#include "reconstruction/factored_surface.h"
#include "support/progress.h"

namespace dd {

/// The geometry whose L and M make up K, the system that gives the displacement of the base.
enum class BaseMetric { surface = 0, base = 1 };

struct BindOptions {
  BaseMetric base_metric = BaseMetric::surface;
  double metric_smoothing = 0;  ///< in mean edge lengths; only with BaseMetric::surface
  Smoothness smoothness = Smoothness::thin_plate;
  Triangulation triangulation = Triangulation::delaunay;
  /// B at rest given by the caller, n×3 in the mesh's units; empty: B is computed with K.
  Positions base = {};
  /// The triangles of that base if its topology differs from the mesh's, else empty. See BaseProxy.
  Triangles base_triangles = {};
  /// Of each vertex, 0 to 1, as for Stiffness; or empty.
  Eigen::VectorXf stiffness = {};
  /// Of the factors and constants that frames read, see PoissonSystem. Full is for comparisons.
  Precision precision = Precision::full;
  /// Threads of the bind and of every frame, the caller's included; 0: all of the machine.
  int threads = 0;
  /// Poses of the mesh for MethodKind::examples, each n×3 in the mesh's units.
  std::vector<Positions> examples = {};
  /// Largest fraction of the mesh's triangles that is bound as a part of it (MeshPart). The result
  /// is that of the whole mesh; 0, to test that, binds the whole mesh. Break-even: to find the part
  /// takes a tenth of the time that the mesh's operators take.
  double largest_part = 0.5;
  /// Least number of free vertices of a FactoredSurface::large one, if the precision is single: the
  /// base of a thin plate is found by MixedBilaplacian, not by a factor of K, and rims are held by
  /// CoarseClamps. Break-even: at 30,000 both are as fast; below this number results keep their
  /// bits.
  int large_from = 200000;
  /// Largest fraction of the free vertices that the coarse mesh of MixedBilaplacian may have.
  /// Break-even: the factor of K there should cost little.
  double largest_contraction = 0.25;
};

/// The operators, factors and base that a bind computes once for all methods.
struct BoundSurface : FactoredSurface {
  /// mesh: S, validated and scaled to a box of about unit size, which absolute tolerances rely on;
  /// a base in the options is in the same coordinates. progress: from 0 to 1. Throws Error.
  BoundSurface(Mesh mesh, const Region& region, const BindOptions& options, ThreadPool& pool,
               const Progress& progress);

  Positions base;  ///< B at rest, n×3
  HandleCoordinates coordinates;
  HandleExtension extension;  ///< displacement of B
  /// The extension by K on S, for MethodKind::variational; empty unless BaseMetric::base makes
  /// `extension` one by K on B.
  HandleExtension surface_extension;

  Rows rest_base;                   ///< B as rows in order()
  std::vector<Positions> examples;  ///< in the coordinates of mesh, n×3 each

  /// Whether the caller gives B. Then the caller gives B' too, and there are no basis functions.
  bool outside_base() const { return extension.empty(); }
  double bytes() const;

 private:
  struct Energy;
  /// K of a metric. on_surface: the block of K on S, if it is known already.
  PolyharmonicSystem factored_energy(const SurfaceOperators& metric, Smoothness smoothness,
                                     const EnergyBlock& on_surface,
                                     const BlockOptions& block_options) const;
  void compute_base(const BindOptions& options, BlockOptions block_options, Energy&& on_surface,
                    const Progress& progress);
  /// Whether MixedBilaplacian may find the base.
  bool may_mix(const BindOptions& options) const;
  /// Finds the base by it. Returns false, with nothing changed, where it can't.
  bool compute_base_mixed(double largest_contraction, ThreadPool& pool, const Progress& progress);
};

}  // namespace dd
