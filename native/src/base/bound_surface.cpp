// SPDX-License-Identifier: GPL-3.0-or-later
#include "base/bound_surface.h"

#include <cmath>
#include <cstdio>
#include <future>
#include <string>
#include <utility>

#include "base/base_surface.h"
#include "base/mixed_bilaplacian.h"
#include "reconstruction/reconstruction.h"
#include "support/run_async.h"
#include "systems/free_block.h"

namespace dd {

namespace {

/// n boundary values for K: at the handles' vertices Σ c_k · coordinate k with unlike coefficients
/// c_k in [−1, 1], elsewhere 0. The error of one solve with them also reveals inaccuracy on
/// components too small to affect the error of the base.
Eigen::VectorXd test_motions(const HandleCoordinates& coordinates, const Region& region,
                             const Positions& positions) {
  Eigen::VectorXd values = Eigen::VectorXd::Zero(positions.rows());
  for (int v : region.handle_vertices) {
    const int h = region.role[v];
    const auto own = coordinates.at(positions.row(v), h);
    for (int k = 0; k < coordinates.count(h); ++k)
      values[v] += own[k] * std::sin(1 + 2.4 * (coordinates.begin(h) + k));
  }
  return values;
}

/// Number of basis functions up to which all are solved for with iterative refinement in full
/// precision: refining so few is a negligible part of a bind.
constexpr int kFewFunctions = 12;

/// The largest error of one solve of K, as a fraction of the largest value, with which basis
/// functions skip iterative refinement. 5e-7 in single precision is less than the error of a
/// frame's own solve (2e-6 allowed). 1e-8 in full precision is above the 5e-11 and 1e-9 measured at
/// 40,401 and 251,001 vertices; a million has 2e-7 (native/bench/RESULTS.md). 0 forces refinement.
double single_solve_tolerance(Precision precision, int functions) {
  if (precision == Precision::single) return 5e-7;
  return functions > kFewFunctions ? 1e-8 : 0;
}

/// single_solve_error: as base_surface() returns it.
HandleExtensionOptions extension_options(const BindOptions& options,
                                         const HandleCoordinates& coordinates,
                                         double single_solve_error, ThreadPool* pool) {
  HandleExtensionOptions result;
  result.pool = pool;
  result.single_solve =
      single_solve_error <= single_solve_tolerance(options.precision, coordinates.count());
  result.precision = options.precision;
  return result;
}

// Most basis functions that MixedBilaplacian finds. Break-even: each four take twice the time that
// they take by a factor of K, which some 28 functions outweigh at 280,000 free vertices, and 56 at
// 770,000.
constexpr int kMostMixedFunctions = 40;

/// The contraction of the active faces that the usual refinement needs as well.
std::shared_ptr<const CoarseMesh> coarse_contraction(const FactoredSurface& surface) {
  const Region& region = surface.region;
  double area = 0;
  for (int j : triangles_with_free_corners(region, surface.operators.triangles))
    area += surface.operators.metric.areas[j];
  const double size = std::sqrt(area);
  return contract_active(surface.mesh, region, surface.operators.triangles,
                         coarse_spacing(Refined{}.rotation_smoothing * size, size));
}

/// Runs work whose systems are built on another geometry than S. An UnsolvableSurface there is no
/// fault of the mesh; it is rethrown as an Error with this message and remedy.
template <class Work>
auto rethrow_as(const std::string& message, Remedy remedy, const Work& work) {
  try {
    return work();
  } catch (const UnsolvableSurface& error) {
    const int v = error.vertex();
    throw Error(Status::numeric, {Subject::vertex, v}, message, remedy, {v});
  }
}

std::string edge_lengths(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}

}  // namespace

/// K on S and its symbolic factorization, computed on a thread of its own while L is factored.
struct BoundSurface::Energy {
  EnergyBlock block;
  std::shared_ptr<const SymbolicCholesky> symbolic;
};

BoundSurface::BoundSurface(Mesh surface, const Region& given_region, const BindOptions& options,
                           ThreadPool& pool, const Progress& progress)
    : FactoredSurface(std::move(surface), given_region, options.triangulation,
                      Stiffness(options.stiffness, given_region)),
      coordinates(region, mesh.positions),
      examples(options.examples) {
  large = options.precision == Precision::single && region.grounds.empty() &&
          region.free_count() >= options.large_from;
  report(progress, 0.05, Stage::poisson);
  SparseMatrix block = free_block(operators.laplacian, region);
  dissection = free_dissection(block, region, mesh.positions, &pool);
  const bool computed = options.base.size() == 0;
  const bool on_surface = computed && options.metric_smoothing == 0;
  const bool mixed = on_surface && may_mix(options);
  std::future<std::shared_ptr<const CoarseMesh>> coarse;
  if (mixed) coarse = run_async(pool.count(), [&] { return coarse_contraction(*this); });
  std::future<Energy> energy;
  if (on_surface && !mixed)
    energy = run_async(pool.count(), [&]() -> Energy {
      EnergyBlock bending = energy_block(even_operators(), region, options.smoothness);
      auto symbolic =
          std::make_shared<SymbolicCholesky>(bending.sparse, dissection->order(bending.sparse));
      return {std::move(bending), std::move(symbolic)};
    });

  BlockOptions block_options;
  block_options.dissection = &*dissection;
  block_options.pool = &pool;
  block_options.precision = options.precision;
  block_options.progress = within(progress, 0.05, 0.15);
  factor(std::move(block), block_options);
  block_options.precision = Precision::full;
  if (mixed) contraction = coarse.get();
  if (!computed)
    base = options.base;
  else if (!mixed || !compute_base_mixed(options.largest_contraction, pool, progress))
    compute_base(options, block_options, energy.valid() ? energy.get() : Energy{}, progress);
  rest_base = in_order(base, order());
}

bool BoundSurface::may_mix(const BindOptions& options) const {
  return large && !even && options.smoothness == Smoothness::thin_plate &&
         options.base_metric == BaseMetric::surface && coordinates.count() <= kMostMixedFunctions;
}

bool BoundSurface::compute_base_mixed(double largest_contraction, ThreadPool& pool,
                                      const Progress& progress) {
  // With a factor that needs refinement, solves are not exact enough.
  if (poisson->correction_steps() > 0 ||
      contraction->free_count > largest_contraction * region.free_count())
    return false;
  try {
    report(progress, 0.2, Stage::energy);
    MixedBilaplacian plate(*this, *contraction);
    report(progress, 0.3, Stage::base);
    Rows values = Rows::Zero(mesh.vertex_count(), 4);
    values.leftCols<3>() = mesh.positions;
    Positions found = mesh.positions;
    found(region.free, kAllIndices) = plate.extend(values).leftCols<3>();
    HandleExtensionOptions how;
    how.pool = &pool;
    how.progress = [&](double done) { report(progress, 0.5 + done * 0.5, Stage::handles); };
    extension = HandleExtension(plate, coordinates, region, mesh.positions, order(), how);
    base = std::move(found);
    return true;
  } catch (const UnsolvableSurface&) {
    return false;
  }
}

PolyharmonicSystem BoundSurface::factored_energy(const SurfaceOperators& metric,
                                                 Smoothness smoothness,
                                                 const EnergyBlock& on_surface,
                                                 const BlockOptions& block_options) const {
  if (&metric == &even_operators() && on_surface.sparse.size() > 0)
    return PolyharmonicSystem(metric, region, smoothness, on_surface, block_options);
  return PolyharmonicSystem(metric, region, smoothness, block_options);
}

void BoundSurface::compute_base(const BindOptions& options, BlockOptions block_options,
                                Energy&& on_surface, const Progress& progress) {
  block_options.symbolic = on_surface.symbolic;
  const auto factored = [&](const SurfaceOperators& metric, double begin, double end, Stage stage) {
    report(progress, begin, stage);
    block_options.progress = within(progress, begin, end);
    block_options.stage = stage;
    PolyharmonicSystem bending =
        factored_energy(metric, options.smoothness, on_surface.block, block_options);
    block_options.symbolic = bending.symbolic();
    return bending;
  };
  const auto extend = [&](const PolyharmonicSystem& bending, double single_solve_error,
                          double begin, double end) {
    HandleExtensionOptions how =
        extension_options(options, coordinates, single_solve_error, block_options.pool);
    how.progress = [&](double done) {
      report(progress, begin + done * (end - begin), Stage::handles);
    };
    return HandleExtension(bending, coordinates, region, mesh.positions, order(), how);
  };
  const Eigen::VectorXd motions = test_motions(coordinates, region, mesh.positions);
  const auto solve_on = [&](const SurfaceOperators& metric, double begin) {
    const PolyharmonicSystem bending = factored(metric, begin, begin + 0.2, Stage::energy);
    report(progress, begin + 0.2, Stage::base);
    double single_solve_error = 0;
    base = base_surface(bending, region, mesh.positions, motions, &single_solve_error);
    (options.base_metric == BaseMetric::base ? surface_extension : extension) =
        extend(bending, single_solve_error, begin + 0.25, begin + 0.4);
  };

  if (options.base_metric == BaseMetric::surface && options.metric_smoothing > 0) {
    rethrow_as("lies where the surface smoothed by " + edge_lengths(options.metric_smoothing) +
                   " edge lengths can't be solved for",
               Remedy::smooth_metric_less, [&] {
                 const SurfaceOperators faired = surface_operators(
                     faired_surface(mesh, even_operators(), options.metric_smoothing),
                     mesh.triangles, options.triangulation);
                 solve_on(faired, 0.15);
               });
  } else {
    solve_on(even_operators(), 0.15);
  }
  if (options.base_metric == BaseMetric::base) {
    rethrow_as("lies where the base surface collapses, so that its stiffness can't be measured",
               Remedy::surface_metric, [&] {
                 // The mesh's own triangles: where the base is crumpled, intrinsic ones gather it
                 // further (on Fig. 3's thorns they make 13 intersections, these none).
                 const SurfaceOperators on_base = surface_operators(base, mesh.triangles);
                 if (operators.flipped) block_options.symbolic = nullptr;
                 const PolyharmonicSystem bending =
                     factored(on_base, 0.6, 0.8, Stage::energy_on_base);
                 double single_solve_error = 1;
                 if (coordinates.count() > kFewFunctions)
                   base_surface(bending, region, base, motions, &single_solve_error);
                 extension = extend(bending, single_solve_error, 0.8, 1);
               });
  }
}

double BoundSurface::bytes() const {
  const auto doubles =
      mesh.positions.size() * Index(examples.size()) + base.size() + rest_base.size();
  return FactoredSurface::bytes() + extension.bytes() + surface_extension.bytes() +
         static_cast<double>(doubles) * sizeof(double);
}

}  // namespace dd
