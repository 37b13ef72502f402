// SPDX-License-Identifier: GPL-3.0-or-later
// The paper's Table 1 on meshes of the same sizes: deformation transfer by fourth points
// (volumetric) against the surface formulation, the same solver for both.
#include <algorithm>
#include <cstdio>
#include <functional>
#include <string>
#include <vector>

#ifdef DD_HAVE_CHOLMOD
#include <Eigen/CholmodSupport>
#endif

#include "cases.h"
#include "reconstruction/fourth_points.h"
#include "solver/fill_reducing_order.h"
#include "systems/free_block.h"
#include "systems/operators.h"
#include "systems/tets.h"
#include "timing.h"

namespace {

using dd::SparseMatrix;
using dd::bench::milliseconds;

/// The median of five runs.
double median(const std::function<void()>& body) {
  std::vector<double> times;
  for (int run = 0; run < 5; ++run) times.push_back(milliseconds(body));
  return dd::bench::median(times);
}

struct Times {
  double order, factor, solve;
};

template <class Solver>
Times timed(const SparseMatrix& A) {
  Solver solver;
  const Eigen::MatrixXd right = Eigen::MatrixXd::Random(A.rows(), 3);
  Eigen::MatrixXd solution;
  Times times{};
  times.order = median([&] { solver.analyzePattern(A); });
  times.factor = median([&] { solver.factorize(A); });
  times.solve = median([&] { solution = solver.solve(right); });
  return times;
}

/// The same by our own factorization.
Times timed_own(const SparseMatrix& A) {
  std::shared_ptr<const dd::SymbolicCholesky> symbolic;
  std::unique_ptr<dd::SparseCholesky> factor;
  Times times{};
  times.order =
      median([&] { symbolic = std::make_shared<dd::SymbolicCholesky>(A, dd::minimum_degree(A)); });
  dd::FactorOptions options;
  options.smallest_pivot = 0;
  times.factor =
      median([&] { factor = std::make_unique<dd::SparseCholesky>(A, symbolic, options); });
  const dd::Rows right = dd::Rows::Random(symbolic->slotted_size(), 4);
  dd::SparseCholesky::SolveScratch space;
  times.solve = median([&] {
    factor->solve_in_order(right.data(), space, nullptr, [](int) {}, [](int, int, const auto*) {});
  });
  return times;
}

struct Example {
  std::string name;
  dd::Mesh mesh;
  double paper[4];  // volumetric factorization, back-substitution; surface ones, in seconds
};

/// All vertices free but 20, which hold the mesh.
std::vector<int> barely_held(const dd::Mesh& mesh) {
  std::vector<int> roles(static_cast<size_t>(mesh.vertex_count()), dd::kFree);
  for (int v = 0; v < 20; ++v) roles[v] = 0;
  return roles;
}

/// A grid of 87,038 triangles with tall narrow bumps: 161 × 273 vertices, without its last quad.
dd::Mesh thorny() {
  dd::Mesh mesh = dd::test::grid(273, 161, [](double x, double y) {
    const double dx = 7 * x - std::floor(7 * x) - 0.5, dy = 4 * y - std::floor(4 * y) - 0.5;
    const double s = std::max(0.0, 1 - 5 * (dx * dx + dy * dy));
    return 0.3 * s * s * s;
  });
  mesh.triangles.conservativeResize(mesh.triangles.rows() - 2, 3);
  mesh.positions.conservativeResize(mesh.positions.rows() - 1, 3);
  return mesh;
}

void print(const char* solver, const Times& volumetric, const Times& surface) {
  std::printf("  %-20s %8.1f %8.1f %8.1f | %8.1f %8.1f %8.1f | %5.1f %5.1f %5.1f\n", solver,
              volumetric.order, volumetric.factor, volumetric.solve, surface.order, surface.factor,
              surface.solve, volumetric.order / surface.order, volumetric.factor / surface.factor,
              volumetric.solve / surface.solve);
}

}  // namespace

int main(int argc, char** argv) {
  const bool quick = argc > 1 && std::string(argv[1]) == "quick";
  std::vector<Example> examples;
  if (!quick) {
    examples.push_back({"Thorn", thorny(), {19.001, 0.228, 3.282, 0.161}});
    examples.push_back({"Bumps", dd::test::bumpy_plane(201), {9.718, 0.172, 3.510, 0.135}});
  }
  examples.push_back(
      {"Cylinder", dd::test::cylinder_of_figure_4(90).mesh, {0.437, 0.021, 0.151, 0.015}});

  std::printf(
      "milliseconds, three columns      volumetric          |          surface           |   "
      "ratios\n");
  std::printf("  %-20s %8s %8s %8s | %8s %8s %8s | %5s %5s %5s\n", "", "order", "factor", "solve",
              "order", "factor", "solve", "order", "fact.", "solve");
  for (const Example& example : examples) {
    const dd::Mesh& mesh = example.mesh;
    const auto roles = barely_held(mesh);
    const dd::Region region = dd::make_region(mesh, roles, 1);
    const auto operators = dd::surface_operators(mesh.positions, mesh.triangles);
    const SparseMatrix surface = dd::free_block(operators.laplacian, region);

    std::vector<int> all(static_cast<size_t>(mesh.triangle_count()));
    std::iota(all.begin(), all.end(), 0);
    const dd::TetMesh solid = dd::with_fourth_points(mesh, all);
    const SparseMatrix G = dd::deformation_operator(solid);
    const Eigen::VectorXd weights = dd::volumes(solid).transpose().replicate(3, 1).reshaped();
    const SparseMatrix whole = G.transpose() * weights.asDiagonal() * G;
    std::vector<int> solid_roles = region.role;
    solid_roles.resize(static_cast<size_t>(solid.vertex_count()), dd::kFree);
    dd::Region solid_region = region;
    solid_region.role = solid_roles;
    for (int v = mesh.vertex_count(); v < solid.vertex_count(); ++v) {
      solid_region.row.push_back(solid_region.free_count());
      solid_region.free.push_back(v);
    }
    const SparseMatrix volumetric = dd::free_block(whole, solid_region);

    const double n = static_cast<double>(surface.rows());
    std::printf("%s: %d triangles, %lld and %lld unknowns, non-zeros %.1f n and %.1f n\n",
                example.name.c_str(), mesh.triangle_count(),
                static_cast<long long>(volumetric.rows()), static_cast<long long>(surface.rows()),
                static_cast<double>(volumetric.nonZeros()) / n,
                static_cast<double>(surface.nonZeros()) / n);
    const double* p = example.paper;
    std::printf("  %-20s %8s %8.0f %8.0f | %8s %8.0f %8.0f | %5s %5.1f %5.1f\n", "the paper, 2006",
                "", 1e3 * p[0], 1e3 * p[1], "", 1e3 * p[2], 1e3 * p[3], "", p[0] / p[2],
                p[1] / p[3]);
    print("own (double, AMD)", timed_own(volumetric), timed_own(surface));
#ifdef DD_HAVE_CHOLMOD
    print("CHOLMOD supernodal", timed<Eigen::CholmodSupernodalLLT<SparseMatrix>>(volumetric),
          timed<Eigen::CholmodSupernodalLLT<SparseMatrix>>(surface));
    print("CHOLMOD simplicial",
          timed<Eigen::CholmodSimplicialLDLT<Eigen::SparseMatrix<double>>>(volumetric),
          timed<Eigen::CholmodSimplicialLDLT<Eigen::SparseMatrix<double>>>(surface));
#endif
  }
#ifndef DD_HAVE_CHOLMOD
  std::printf("CHOLMOD was not found: no comparison with it (install libsuitesparse-dev).\n");
#endif
  return 0;
}
