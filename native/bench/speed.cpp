// SPDX-License-Identifier: GPL-3.0-or-later
// Times of a bind and a frame of the bumpy plane of Fig. 1 with its right side lifted, beside the
// same systems factored and solved by other libraries in the same run, and beside the bandwidth of
// this machine's memory.
//
//   speed [--side 201] [--scale 101,201,317,501,1001] [--patch 317,1001,2001] [--json FILE]
//
// Set OPENBLAS_NUM_THREADS=1: all is one thread unless it says otherwise.
#include <sys/resource.h>

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <memory>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "deform/draft.h"
#include "kernels/kernels.h"
#include "machine.h"
#include "meshes.h"
#include "systems/free_block.h"
#include "systems/polyharmonic_system.h"
#include "timing.h"
#ifdef DD_HAVE_CGAL
#include "cgal_peer.h"
#endif
#ifdef DD_HAVE_CHOLMOD
#include "cholmod_peer.h"
#endif
#ifdef DD_HAVE_IGL
#include "igl_peer.h"
#endif
#ifdef DD_HAVE_PARDISO
#include <mkl_service.h>

#include <Eigen/PardisoSupport>
#endif

namespace {

using dd::bench::median;
using dd::bench::milliseconds;

/// Everything that is measured, by name, for the table and the file.
class Report {
 public:
  void add(const std::string& name, double value) { values_.emplace_back(name, value); }
  void write(const char* path) const {
    std::FILE* file = std::fopen(path, "w");
    if (!file) {
      std::fprintf(stderr, "%s can't be written.\n", path);
      std::exit(1);
    }
    std::fprintf(file, "{\n");
    for (size_t i = 0; i < values_.size(); ++i)
      std::fprintf(file, "  \"%s\": %.6g%s\n", values_[i].first.c_str(), values_[i].second,
                   i + 1 < values_.size() ? "," : "");
    std::fprintf(file, "}\n");
    std::fclose(file);
  }

 private:
  std::vector<std::pair<std::string, double>> values_;
};

/// Bodies that are timed by turns, so that a change in the machine's speed affects all alike.
class Contest {
 public:
  void enter(const std::string& key, const std::string& name, std::function<void()> body) {
    contenders_.push_back({key, name, std::move(body), {}});
  }
  void run(int rounds) {
    for (int round = -2; round < rounds; ++round)
      for (Contender& c : contenders_) {
        const double ms = milliseconds(c.body);
        if (round >= 0) c.times.push_back(ms);
      }
  }
  bool has(const std::string& key) const {
    for (const Contender& c : contenders_)
      if (c.key == key) return true;
    return false;
  }
  double time(const std::string& key) const {
    for (const Contender& c : contenders_)
      if (c.key == key) return median(c.times);
    return std::nan("");
  }
  void print(Report& report) const {
    for (const Contender& c : contenders_) {
      std::printf("  %-52s %9.3f ms\n", c.name.c_str(), median(c.times));
      report.add(c.key + "_ms", median(c.times));
    }
  }
  void ratio(Report& report, const std::string& a, const std::string& b, const char* limit) const {
    if (!has(a) || !has(b)) return;
    std::printf("  %-40s %6.3f   (%s)\n", (a + " / " + b).c_str(), time(a) / time(b), limit);
    report.add(a + "/" + b, time(a) / time(b));
  }

 private:
  struct Contender {
    std::string key, name;
    std::function<void()> body;
    std::vector<double> times;
  };
  std::vector<Contender> contenders_;
};

/// Memory bandwidth as STREAM measures it, on arrays that no cache holds.
struct Bandwidth {
  double triad = 0, read = 0;  // GB/s
};
Bandwidth measure_bandwidth() {
  const Eigen::Index count = 16 << 20;
  Eigen::ArrayXf a = Eigen::ArrayXf::Zero(count), b = Eigen::ArrayXf::Ones(count),
                 c = Eigen::ArrayXf::Ones(count);
  Bandwidth best;
  double sum = 0;
  for (int round = 0; round < 8; ++round) {
    const double triad = milliseconds([&] { a = b + 3.0f * c; });
    const double read = milliseconds([&] { sum += static_cast<double>(b.sum()); });
    best.triad = std::max(best.triad, 12e-6 * static_cast<double>(count) / triad);
    best.read = std::max(best.read, 4e-6 * static_cast<double>(count) / read);
  }
  if (sum < 0 || a[1] < 0) std::printf("never\n");
  return best;
}

struct Scene {
  explicit Scene(int side)
      : mesh(dd::test::bumpy_plane(side)),
        roles(dd::test::strip_roles(side, side, side * 23 / 201, side * 178 / 201)) {
    lift(2, 3) = 0.4;
  }
  dd::Mesh mesh;
  std::vector<int> roles;
  dd::test::Affine lift = dd::test::identity();

  static dd::BindOptions options(int threads) {
    dd::BindOptions options;
    options.precision = dd::Precision::single;
    options.threads = threads;
    return options;
  }
  std::unique_ptr<dd::Deformer> bound(int threads) const {
    return std::make_unique<dd::Deformer>(mesh, roles, 1, options(threads));
  }
  std::unique_ptr<dd::Draft> draft(int threads) const {
    return dd::Draft::make(mesh, roles, 1, options(threads));
  }
};

dd::UpdateOptions refined(int iterations) {
  dd::UpdateOptions options;
  options.of_method.refined.iterations = iterations;
  options.of_method.refined.rim_smoothing = iterations > 0 ? 0.05 : 0;  // the default, or (14)
  return options;
}

/// A move by the deformation methods of other libraries.
void other_methods([[maybe_unused]] const Scene& scene, [[maybe_unused]] double update,
                   [[maybe_unused]] double update_4, [[maybe_unused]] Report& report) {
  [[maybe_unused]] const auto compare = [&](const char* key, const char* name, const char* own_key,
                                            double own, const char* limit, const auto& deform) {
    std::vector<double> moves, preparing;
    for (int round = 0; round < 3; ++round) {
      const auto result = deform();
      moves.push_back(result.moving_ms);
      preparing.push_back(result.preparing_ms);
    }
    std::printf("  %s: prepared in %.0f ms, a move in %.0f ms\n", name, median(preparing),
                median(moves));
    const std::string ratio = std::string(key) + " / " + own_key;
    std::printf("  %-40s %6.1f   (%s)\n", ratio.c_str(), median(moves) / own, limit);
    report.add(std::string(key) + "_ms", median(moves));
    report.add(ratio, median(moves) / own);
  };
#ifdef DD_HAVE_CGAL
  compare("cgal_sre_arap", "CGAL SRE-ARAP, 5 iterations", "update_4", update_4, "at least 8", [&] {
    return dd::bench::deform_with_cgal(scene.mesh, scene.roles, scene.lift,
                                       dd::bench::CgalMethod::smoothed_rotations, 5);
  });
#endif
#ifdef DD_HAVE_IGL
  compare("igl_arap", "libigl ARAP, 10 iterations", "update_4", update_4, "", [&] {
    return dd::bench::deform_with_igl(scene.mesh, scene.roles, scene.lift,
                                      dd::bench::IglMethod::arap, 10);
  });
  compare("igl_biharmonic", "libigl biharmonic", "update", update, "", [&] {
    return dd::bench::deform_with_igl(scene.mesh, scene.roles, scene.lift,
                                      dd::bench::IglMethod::biharmonic);
  });
#endif
}

void frame(const Scene& scene, const Bandwidth& bandwidth, Report& report) {
  const auto one = scene.bound(1), two = scene.bound(2);
  const dd::Region& region = one->region();
  const dd::SurfaceOperators operators =
      dd::surface_operators(scene.mesh.positions, scene.mesh.triangles);
  const dd::SparseMatrix poisson = dd::free_block(operators.laplacian, region);
  const dd::Dissection dissection = dd::free_dissection(poisson, region, scene.mesh.positions);
  dd::BlockOptions block_options;
  block_options.precision = dd::Precision::single;
  block_options.dissection = &dissection;
  const dd::SparseCholesky own = dd::factor_free_block(poisson, region, block_options);
  const dd::Rows panel = dd::Rows::Random(own.symbolic().slotted_size(), 4);
  dd::SparseCholesky::SolveScratch space;
  std::vector<float> out(3 * static_cast<size_t>(scene.mesh.vertex_count()));
  const auto update = [&](dd::Deformer& deformer, int iterations) {
    return [&deformer, &out, &scene, options = refined(iterations)] {
      deformer.update_to(out.data(), 3, false, scene.lift.data(), options);
    };
  };

  std::printf("A frame: %d vertices, %d triangles, %d unknowns, kernels %s\n",
              scene.mesh.vertex_count(), scene.mesh.triangle_count(), region.free_count(),
              dd::kernels().name);
  Contest contest;
  contest.enter("update", "update, handles to floats", update(*one, 0));
  contest.enter("update_4", "  with 4 refinements", update(*one, 4));
  contest.enter("update_5", "  with 5 refinements", update(*one, 5));
  contest.enter("update_2_threads", "update by 2 threads", update(*two, 0));
  contest.enter("update_4_2_threads", "  with 4 refinements", update(*two, 4));
  contest.enter("solve", "its solve alone", [&] {
    own.solve_in_order(panel.data(), space, nullptr, [](int) {}, [](int, int, const auto*) {});
  });
  const Eigen::MatrixXd right = Eigen::MatrixXd::Random(region.free_count(), 3);
  Eigen::MatrixXd solution;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> eigen(poisson);
  contest.enter("eigen_solve", "Eigen SimplicialLDLT solve",
                [&] { solution = eigen.solve(right); });
#ifdef DD_HAVE_CHOLMOD
  dd::bench::Cholmod supernodal(poisson, true), simplicial(poisson, false);
  supernodal.factor();
  simplicial.factor();
  contest.enter("cholmod_supernodal_solve", "CHOLMOD supernodal, cholmod_solve2",
                [&] { supernodal.solve(right); });
  contest.enter("cholmod_simplicial_solve", "CHOLMOD simplicial, cholmod_solve2",
                [&] { simplicial.solve(right); });
#else
  std::printf("CHOLMOD was not found: no comparison with it (install libsuitesparse-dev).\n");
#endif
#ifdef DD_HAVE_PARDISO
  Eigen::PardisoLLT<dd::SparseMatrix> pardiso;
  pardiso.pardisoParameterArray()[7] = 0;  // no steps of iterative refinement
  pardiso.compute(poisson);
  contest.enter("pardiso_solve", "MKL PARDISO solve", [&] { solution = pardiso.solve(right); });
#endif
  const bool large = region.free_count() > 100000;
  contest.run(large ? 11 : 41);
  contest.print(report);
  const double refinement = contest.time("update_5") - contest.time("update_4");
  const double floor_ms = 2 * 4e-6 * static_cast<double>(own.entries()) / bandwidth.read;
  std::printf("  %-52s %9.3f ms\n", "one refinement", refinement);
  std::printf("  %-52s %9.3f ms\n", "reading the float factor twice, at the bandwidth", floor_ms);
  report.add("refinement_ms", refinement);
  report.add("factor_entries", static_cast<double>(own.entries()));
  std::printf("Ratios\n");
  contest.ratio(report, "solve", "cholmod_supernodal_solve", "at most 0.3");
  contest.ratio(report, "solve", "cholmod_simplicial_solve", "at most 0.6");
  contest.ratio(report, "solve", "eigen_solve", "");
  contest.ratio(report, "solve", "pardiso_solve", "");
  contest.ratio(report, "update", "cholmod_supernodal_solve", "at most 0.6");
  contest.ratio(report, "update_2_threads", "update", "at most 0.65");
  std::printf("  %-40s %6.3f   (at most 1.5)\n", "refinement / update",
              refinement / contest.time("update"));
  std::printf("  %-40s %6.3f   (at most 2 at 250,000 vertices)\n", "solve / reading",
              contest.time("solve") / floor_ms);
  report.add("refinement/update", refinement / contest.time("update"));
  report.add("solve/reading", contest.time("solve") / floor_ms);
  if (!large) other_methods(scene, contest.time("update"), contest.time("update_4"), report);
}

void bind(const Scene& scene, Report& report) {
  std::printf("\nA bind: %d vertices, base surface, basis of one handle and the method included\n",
              scene.mesh.vertex_count());
  std::unique_ptr<dd::Deformer> bound;
  Contest contest;
  contest.enter("bind", "bind", [&] { bound = scene.bound(1); });
  contest.enter("bind_2_threads", "  by 2 threads", [&] { bound = scene.bound(2); });
#if defined(DD_HAVE_CHOLMOD) || defined(DD_HAVE_PARDISO)
  const dd::Region region = dd::make_region(scene.mesh, scene.roles, 1);
  const dd::SurfaceOperators operators =
      dd::surface_operators(scene.mesh.positions, scene.mesh.triangles);
  const dd::SparseMatrix L = dd::free_block(operators.laplacian, region);
  const dd::SparseMatrix K = dd::energy_block(operators, region, dd::Smoothness::thin_plate).sparse;
#endif
#ifdef DD_HAVE_CHOLMOD
  contest.enter("cholmod_analyze_factor", "CHOLMOD: AMD analyze + supernodal factor, L and K", [&] {
    for (const dd::SparseMatrix* matrix : {&L, &K}) dd::bench::Cholmod(*matrix, true).factor();
  });
#endif
#ifdef DD_HAVE_PARDISO
  contest.enter("pardiso_analyze_factor", "MKL PARDISO: analyze + factor, L and K", [&] {
    for (const dd::SparseMatrix* matrix : {&L, &K}) Eigen::PardisoLLT<dd::SparseMatrix>{*matrix};
  });
#endif
  contest.run(scene.mesh.vertex_count() > 100000 ? 3 : 9);
  contest.print(report);
  contest.ratio(report, "bind", "cholmod_analyze_factor",
                "at most 0.7 at 40,000 vertices, 1.0 at 250,000");
  contest.ratio(report, "bind", "pardiso_analyze_factor", "");
  contest.ratio(report, "bind_2_threads", "bind", "");
}

double peak_megabytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;
}

void scale(const std::vector<int>& sides, Report& report) {
  std::printf("\n%10s %10s %10s %10s %10s %10s %10s %10s\n", "vertices", "bind ms", "update ms",
              "4 refined", "draft ms", "update ms", "held MB", "peak MB");
  std::vector<double> n, binds, updates;
  for (int side : sides) {
    const Scene scene(side);
    std::unique_ptr<dd::Deformer> bound;
    std::unique_ptr<dd::Draft> draft;
    std::vector<double> times[5];
    for (int round = 0; round < 3; ++round) {
      bound.reset();
      times[0].push_back(milliseconds([&] { bound = scene.bound(1); }));
      times[3].push_back(milliseconds([&] { draft = scene.draft(1); }));
    }
    std::vector<float> out(3 * static_cast<size_t>(scene.mesh.vertex_count()));
    for (int round = -1; round < 9; ++round)
      for (int k = 0; k < 2; ++k) {
        const double ms = milliseconds(
            [&] { bound->update_to(out.data(), 3, false, scene.lift.data(), refined(4 * k)); });
        if (round >= 0) times[1 + k].push_back(ms);
      }
    for (int round = 0; round < 9; ++round)
      times[4].push_back(draft ? milliseconds([&] { draft->update(scene.lift.data(), refined(4)); })
                               : std::nan(""));
    std::printf("%10d %10.1f %10.2f %10.2f %10.1f %10.2f %10.1f %10.0f\n",
                scene.mesh.vertex_count(), median(times[0]), median(times[1]), median(times[2]),
                draft ? median(times[3]) : std::nan(""), median(times[4]), bound->bytes() / 1e6,
                peak_megabytes());
    const std::string key = std::to_string(scene.mesh.vertex_count());
    report.add("scale_" + key + "_bind_ms", median(times[0]));
    report.add("scale_" + key + "_update_ms", median(times[1]));
    report.add("scale_" + key + "_update_4_ms", median(times[2]));
    if (draft) report.add("scale_" + key + "_draft_ms", median(times[3]));
    report.add("scale_" + key + "_held_mb", bound->bytes() / 1e6);
    report.add("scale_" + key + "_peak_mb", peak_megabytes());
    n.push_back(scene.mesh.vertex_count());
    binds.push_back(median(times[0]));
    updates.push_back(median(times[1]));
  }
  if (n.size() < 2) return;
  const auto exponent = [&](const std::vector<double>& times, size_t from) {
    return std::log(times.back() / times[from]) / std::log(n.back() / n[from]);
  };
  // Over the last decade of sizes, or all.
  size_t from = 0;
  while (from + 2 < n.size() && n[from + 1] < n.back() / 9.5) ++from;
  std::printf(
      "from %.0f to %.0f vertices: bind grows as n^%.2f (at most 1.35), update as n^%.2f (at "
      "most 1.15)\n",
      n[from], n.back(), exponent(binds, from), exponent(updates, from));
  report.add("bind_exponent", exponent(binds, from));
  report.add("update_exponent", exponent(updates, from));
}

/// A patch of some 8,000 vertices on planes of these sides, bound as a part of the mesh and with
/// all of it, which gives the same bits.
void patch(const std::vector<int>& sides, Report& report) {
  std::printf("\n%10s %10s %10s %10s %10s %10s\n", "vertices", "bound", "bind ms", "first ms",
              "update ms", "held MB");
  for (int side : sides) {
    const dd::Mesh mesh = dd::test::bumpy_plane(side);
    std::vector<int> roles(static_cast<size_t>(mesh.vertex_count()), dd::kFixed);
    constexpr double kRadius = 50;  // in edges
    for (int i = 0; i < side; ++i)
      for (int j = 0; j < side; ++j) {
        const double distance = std::hypot(i - side / 2, j - side / 2) / kRadius;
        if (distance < 1)
          roles[static_cast<size_t>(i) * side + j] = distance < 0.15 ? 0 : dd::kFree;
      }
    dd::test::Affine lift = dd::test::identity();
    lift(2, 3) = 0.3 * kRadius / side;
    std::vector<float> out(3 * static_cast<size_t>(mesh.vertex_count()));
    for (const bool whole : {true, false}) {
      dd::BindOptions options = Scene::options(1);
      if (whole) options.largest_part = 0;
      std::vector<double> times[3];
      double bytes = 0;
      for (int round = 0; round < 3; ++round) {
        std::unique_ptr<dd::Deformer> bound;
        times[0].push_back(
            milliseconds([&] { bound = std::make_unique<dd::Deformer>(mesh, roles, 1, options); }));
        for (int k : {1, 2})
          times[k].push_back(milliseconds(
              [&] { bound->update_to(out.data(), 3, false, lift.data(), refined(4)); }));
        bytes = bound->bytes();
      }
      std::printf("%10d %10s %10.1f %10.1f %10.2f %10.1f\n", mesh.vertex_count(),
                  whole ? "all" : "part", median(times[0]), median(times[1]), median(times[2]),
                  bytes / 1e6);
      const std::string key =
          "patch_" + std::to_string(mesh.vertex_count()) + (whole ? "_all_" : "_part_");
      report.add(key + "bind_ms", median(times[0]));
      report.add(key + "first_ms", median(times[1]));
      report.add(key + "update_ms", median(times[2]));
      report.add(key + "held_mb", bytes / 1e6);
    }
  }
}

std::vector<int> numbers(const char* text) {
  std::vector<int> found;
  std::stringstream list(text);
  for (std::string one; std::getline(list, one, ',');) found.push_back(std::stoi(one));
  return found;
}

}  // namespace

int main(int argc, char** argv) {
  int side = 201;
  std::vector<int> sides, patched;
  const char* json = nullptr;
  for (int i = 1; i + 1 < argc; i += 2) {
    if (!std::strcmp(argv[i], "--side")) side = std::atoi(argv[i + 1]);
    if (!std::strcmp(argv[i], "--json")) json = argv[i + 1];
    if (!std::strcmp(argv[i], "--scale")) sides = numbers(argv[i + 1]);
    if (!std::strcmp(argv[i], "--patch")) patched = numbers(argv[i + 1]);
  }
  if (side < 10 && side != 0) return std::fprintf(stderr, "The side must be at least 10.\n"), 2;
#ifdef DD_HAVE_PARDISO
  mkl_set_num_threads(1);
#endif
  Report report;
  const Bandwidth bandwidth = measure_bandwidth();
  std::printf("%s\n", dd::bench::machine().c_str());
  std::printf("Memory, one thread: %.1f GB/s read, %.1f GB/s triad\n\n", bandwidth.read,
              bandwidth.triad);
  report.add("bandwidth_read_gb_s", bandwidth.read);
  report.add("bandwidth_triad_gb_s", bandwidth.triad);
  if (side > 0) {
    const Scene scene(side);
    frame(scene, bandwidth, report);
    bind(scene, report);
  }
  if (!sides.empty()) scale(sides, report);
  if (!patched.empty()) patch(patched, report);
  if (json) report.write(json);
  return 0;
}
