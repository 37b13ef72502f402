// SPDX-License-Identifier: GPL-3.0-or-later
#include "base/bound_surface.h"

#include <cmath>
#include <cstdio>
#include <future>
#include <string>
#include <utility>

#include "base/base_surface.h"
#include "support/beside.h"
#include "systems/free_block.h"

namespace dd {

namespace {

/// n boundary values for K: at the handles' vertices Σ c_k · coordinate k with unlike coefficients
/// c_k in [−1, 1], elsewhere 0. The error of one solve with them also reveals inaccuracy on
/// components too small to affect the error of the base.
Eigen::VectorXd unlike_motions(const HandleCoordinates& coordinates, const Region& region,
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
double exact_enough(Precision precision, int functions) {
  if (precision == Precision::single) return 5e-7;
  return functions > kFewFunctions ? 1e-8 : 0;
}

/// Runs work whose systems are built on another geometry than S. An UnsolvableSurface there is no
/// fault of the mesh; it is rethrown as an Error with this message and remedy.
template <class Work>
auto blaming(const std::string& message, Remedy remedy, const Work& work) {
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

BoundSurface::BoundSurface(Mesh surface, const Region& its_region, const BindOptions& options,
                           ThreadPool& pool, const Progress& progress)
    : FactoredSurface(std::move(surface), its_region, options.triangulation),
      coordinates(region, mesh.positions),
      examples(options.examples) {
  report(progress, 0.05, Stage::poisson);
  SparseMatrix block = free_block(operators.laplacian, region);
  dissection = free_dissection(block, region, mesh.positions, &pool);
  const bool computed = options.base.size() == 0;
  const bool on_surface = computed && options.metric_smoothing == 0;
  std::future<Energy> energy;
  if (on_surface)
    energy = beside(pool.count(), [&]() -> Energy {
      EnergyBlock bending = energy_block(operators, region, options.smoothness);
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
  if (computed) {
    compute_base(options, block_options, on_surface ? energy.get() : Energy{}, progress);
  } else {
    base = options.base;
  }
  rest_base = in_order(base, order());
}

void BoundSurface::compute_base(const BindOptions& options, BlockOptions how, Energy&& on_surface,
                                const Progress& progress) {
  how.symbolic = on_surface.symbolic;
  const auto factored = [&](const SurfaceOperators& metric, double begin, double end, Stage stage) {
    report(progress, begin, stage);
    how.progress = within(progress, begin, end);
    how.stage = stage;
    const bool made = &metric == &operators && on_surface.block.sparse.size() > 0;
    PolyharmonicSystem bending =
        made ? PolyharmonicSystem(metric, region, options.smoothness, on_surface.block, how)
             : PolyharmonicSystem(metric, region, options.smoothness, how);
    how.symbolic = bending.symbolic();
    return bending;
  };
  const auto extend_handles = [&](const PolyharmonicSystem& bending, double one_solve_error,
                                  double begin, double end) {
    return HandleExtension(bending, coordinates, region, mesh.positions, order(), *how.pool,
                           one_solve_error <= exact_enough(options.precision, coordinates.count()),
                           options.precision, KeptOfEnergy::cheaper, [&](double done) {
                             report(progress, begin + done * (end - begin), Stage::handles);
                           });
  };
  const Eigen::VectorXd motions = unlike_motions(coordinates, region, mesh.positions);
  const auto solve_on = [&](const SurfaceOperators& metric, double begin) {
    const PolyharmonicSystem bending = factored(metric, begin, begin + 0.2, Stage::energy);
    report(progress, begin + 0.2, Stage::base);
    double one_solve_error = 0;
    base = base_surface(bending, region, mesh.positions, motions, &one_solve_error);
    (options.base_metric == BaseMetric::base ? surface_extension : extension) =
        extend_handles(bending, one_solve_error, begin + 0.25, begin + 0.4);
  };

  if (options.base_metric == BaseMetric::surface && options.metric_smoothing > 0) {
    blaming("lies where the surface smoothed by " + edge_lengths(options.metric_smoothing) +
                " edge lengths can't be solved for",
            Remedy::smooth_metric_less, [&] {
              const SurfaceOperators faired =
                  surface_operators(faired_surface(mesh, operators, options.metric_smoothing),
                                    mesh.triangles, options.triangulation);
              solve_on(faired, 0.15);
            });
  } else {
    solve_on(operators, 0.15);
  }
  if (options.base_metric == BaseMetric::base) {
    blaming("lies where the base surface collapses, so that its stiffness can't be measured",
            Remedy::surface_metric, [&] {
              // The mesh's own triangles: where the base is crumpled, intrinsic ones gather it
              // further (on Fig. 3's thorns they make 13 intersections, these none).
              const SurfaceOperators on_base = surface_operators(base, mesh.triangles);
              if (operators.flipped) how.symbolic = nullptr;
              const PolyharmonicSystem bending = factored(on_base, 0.6, 0.8, Stage::energy_on_base);
              double one_solve_error = 1;
              if (coordinates.count() > kFewFunctions)
                base_surface(bending, region, base, motions, &one_solve_error);
              extension = extend_handles(bending, one_solve_error, 0.8, 1);
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
