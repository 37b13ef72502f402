// SPDX-License-Identifier: GPL-3.0-or-later
// Cost of a frame, handles to positions, beside solves of the same Poisson system by other
// libraries, in one run: the bumpy plane of Fig. 1 with its right side lifted.
//
//   frame_bench [vertices along a side, default 201]
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <string>
#include <vector>

#ifdef DD_HAVE_CHOLMOD
#include <Eigen/CholmodSupport>
#endif

#include "deformer.h"
#include "free_block.h"
#include "kernels.h"
#include "meshes.h"

namespace {

using Clock = std::chrono::steady_clock;

double once(const std::function<void()>& body) {
  const auto start = Clock::now();
  body();
  return 1e3 * std::chrono::duration<double>(Clock::now() - start).count();
}

struct Contender {
  std::string name;
  std::function<void()> body;
  std::vector<double> times;
  double median() {
    std::sort(times.begin(), times.end());
    return times[times.size() / 2];
  }
};

}  // namespace

int main(int argc, char** argv) {
  const int side = argc > 1 ? std::atoi(argv[1]) : 201;
  if (side < 10) return std::fprintf(stderr, "The side must be at least 10.\n"), 2;
  const dd::Mesh mesh = dd::test::bumpy_plane(side);
  const auto roles = dd::test::strip_roles(side, side, side * 23 / 201, side * 178 / 201);

  dd::BindOptions bind_options;
  bind_options.precision = dd::Precision::single;
  bind_options.threads = argc > 2 ? std::atoi(argv[2]) : 1;
  std::unique_ptr<dd::Deformer> deformer;
  const double bind =
      once([&] { deformer = std::make_unique<dd::Deformer>(mesh, roles, 1, bind_options); });
  const dd::Region& region = deformer->region();
  std::printf("%d vertices, %d triangles, %d unknowns, kernels: %s\n", mesh.vertex_count(),
              mesh.triangle_count(), region.free_count(), dd::kernels().name);
  std::printf("bind %.0f ms, %.1f MB held\n\n", bind, deformer->bytes() / 1e6);

  const dd::SurfaceOperators operators = dd::surface_operators(mesh.positions, mesh.triangles);
  const dd::SparseMatrix poisson = dd::free_block(operators.laplacian, region);
  const Eigen::MatrixXd right = Eigen::MatrixXd::Random(region.free_count(), 3);

  dd::test::Affine lift = dd::test::identity();
  lift(2, 3) = 0.4;
  dd::BlockOptions block_options;
  block_options.precision = dd::Precision::single;
  const dd::Dissection dissection = dd::free_dissection(poisson, region, mesh.positions);
  block_options.dissection = &dissection;
  const dd::SparseCholesky own = dd::factor_free_block(poisson, region, block_options);
  const dd::Rows panel = dd::Rows::Random(own.elimination().slotted_size(), 4);
  dd::SparseCholesky::Space space;
  std::vector<float> out(3 * static_cast<size_t>(mesh.vertex_count()));
  Eigen::SimplicialLDLT<dd::SparseMatrix> eigen(poisson);
  Eigen::MatrixXd solution;

  dd::UpdateOptions refined, refined_once_more;
  refined.of_method.refine = 4;
  refined_once_more.of_method.refine = 5;

  std::vector<Contender> contenders = {
      {"update, handles to positions", [&] { deformer->update_to(out.data(), false, lift.data(), {}); }, {}},
      {"  with 4 refinements", [&] { deformer->update_to(out.data(), false, lift.data(), refined); }, {}},
      {"  with 5 refinements", [&] { deformer->update_to(out.data(), false, lift.data(), refined_once_more); }, {}},
      {"  its solve alone", [&] { own.solve_in_order(panel.data(), space, nullptr, [](int) {}, [](int, int, const auto*) {}); }, {}},
      {"Eigen SimplicialLDLT solve", [&] { solution = eigen.solve(right); }, {}}};
#ifdef DD_HAVE_CHOLMOD
  Eigen::CholmodSupernodalLLT<dd::SparseMatrix> supernodal(poisson);
  Eigen::CholmodSimplicialLDLT<dd::SparseMatrix> simplicial(poisson);
  contenders.push_back(
      {"CHOLMOD supernodal solve", [&] { solution = supernodal.solve(right); }, {}});
  contenders.push_back(
      {"CHOLMOD simplicial solve", [&] { solution = simplicial.solve(right); }, {}});
#else
  std::printf("CHOLMOD was not found: no comparison with it (install libsuitesparse-dev).\n");
#endif

  // Turn by turn, so that a change in the machine's speed falls on all alike.
  const int rounds = 41;
  for (int round = -3; round < rounds; ++round)
    for (Contender& c : contenders) {
      const double ms = once(c.body);
      if (round >= 0) c.times.push_back(ms);
    }

  const double update = contenders[0].median();
  std::printf("%-32s %9s %15s\n", "three columns", "median ms", "update / this");
  for (Contender& c : contenders)
    std::printf("%-32s %9.3f %15.2f\n", c.name.c_str(), c.median(), update / c.median());
  return 0;
}
