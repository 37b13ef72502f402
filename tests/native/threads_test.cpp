// SPDX-License-Identifier: GPL-3.0-or-later
// Results don't depend on threads. The thread sanitizer runs the tests tagged [threads].
#include <atomic>
#include <chrono>
#include <fstream>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "catch.h"
#include "deform.h"
#include "match/registration.h"
#include "match/triangle_match.h"
#include "support/thread_pool.h"
#include "tapered_limb.h"

using namespace dd;
using test::Affine;

namespace {

constexpr int kSide = 41;
const auto kKinds = {MethodKind::detail,   MethodKind::variational, MethodKind::normal,
                     MethodKind::gradient, MethodKind::volumes,     MethodKind::examples};

Affine turn(double angle) { return test::rotation_about(angle, {0, 1, 0}, {0, 0, 0}, {0, 0, 0.2}); }

std::unique_ptr<Deformer> bound(int bumps, int threads, int side = kSide) {
  const Mesh mesh = test::bumpy_plane(side, bumps);
  BindOptions options;
  options.precision = Precision::single;
  options.threads = threads;
  options.examples = {test::transformed(turn(0.3), mesh.positions)};
  return std::make_unique<Deformer>(mesh, test::strip_roles(side, side, 4, side - 4), 1, options);
}

std::vector<Positions> by_all_methods(Deformer& deformer) {
  std::vector<Positions> surfaces;
  for (const MethodKind kind : kKinds)
    for (const double angle : {0.2, 0.4})
      surfaces.push_back(test::surface(deformer, {turn(angle)}, test::by(kind)));
  return surfaces;
}

}  // namespace

TEST_CASE("the number of threads changes no method", "[threads]") {
  const auto alone = by_all_methods(*bound(6, 1)), shared = by_all_methods(*bound(6, 3));
  CHECK(alone == shared);
}

TEST_CASE("the number of threads changes no refinement, whose parts are made at once",
          "[threads]") {
  for (const int side : {kSide, 121}) {  // from 10,000 free vertices on a coarse surface
    const auto refined = [&](int threads) {
      return test::surface(*bound(6, threads, side), {turn(0.4)}, test::usual());
    };
    CHECK(refined(1) == refined(3));
  }
}

TEST_CASE("the number of threads changes neither solid limbs nor stiff parts", "[threads]") {
  for (const int density : {1, 3}) {  // with 15,122 vertices on a coarse surface
    const test::TaperedLimb limb(0.5, 0.3, 1, density, 0.08);
    const auto twisted = [&](int threads) {
      BindOptions options;
      options.threads = threads;
      options.stiffness = (limb.mesh.positions.col(2).array() > 2.4).cast<float>();
      Deformer deformer(limb.mesh, limb.roles, 1, options);
      return test::surface(deformer, {test::TaperedLimb::twist(2 * 180 / kPi)},
                           test::solid(1, {0, 0, 2}));
    };
    CHECK(twisted(1) == twisted(3));
  }
}

TEST_CASE("deformers that bind and update at once give what each gives alone", "[threads]") {
  const std::vector<int> bumps = {3, 5, 7};
  std::vector<std::vector<Positions>> alone, together(bumps.size());
  for (const int count : bumps) alone.push_back(by_all_methods(*bound(count, 1)));
  std::vector<std::thread> threads;
  for (size_t i = 0; i < bumps.size(); ++i)
    threads.emplace_back([&, i] { together[i] = by_all_methods(*bound(bumps[i], 2)); });
  for (std::thread& thread : threads) thread.join();
  CHECK(alone == together);
}

TEST_CASE("the number of threads changes neither a registration nor a match", "[threads]") {
  const Mesh source = test::sphere(3), target = test::rough_sphere(4, 0.05);
  // The corners of the octahedron stay the first vertices through all levels.
  const Pairs markers = {{0, 0}, {1, 1}, {2, 2}, {3, 3}, {4, 4}, {5, 5}};
  const auto registered = [&](int threads) {
    RegistrationOptions options;
    options.threads = threads;
    return register_onto(source, target, markers, options);
  };
  const Mesh alone = {registered(1), source.triangles};
  CHECK(alone.positions == registered(3));
  CHECK(match_triangles(alone, target, 0.1, 1).confidence ==
        match_triangles(alone, target, 0.1, 3).confidence);
}

TEST_CASE("each task is called once, whether helpers wait awake, sleep or one throws",
          "[threads]") {
  ThreadPool pool(4);
  for (int round = 0; round < 300; ++round) {
    if (round % 50 == 0) std::this_thread::sleep_for(std::chrono::milliseconds(2));
    std::vector<int> calls(64);
    pool.run(64, [&](int i) { ++calls[size_t(i)]; });
    REQUIRE(calls == std::vector<int>(64, 1));
    if (round % 10 == 0)
      REQUIRE_THROWS_AS(pool.run(64,
                                 [](int i) {
                                   if (i % 16 == 3) throw std::runtime_error("one of them");
                                 }),
                        std::runtime_error);
  }
}

TEST_CASE("several callers of one pool, and tasks that call it, get all of their tasks done",
          "[threads]") {
  ThreadPool pool(3);
  constexpr int kCallers = 4, kRounds = 50, kTasks = 16;
  std::vector<std::vector<int>> counts(kCallers, std::vector<int>(kTasks * kTasks, 0));
  std::vector<std::thread> callers;
  for (std::vector<int>& own : counts)
    callers.emplace_back([&] {
      for (int round = 0; round < kRounds; ++round)
        pool.run(kTasks,
                 [&](int i) { pool.run(kTasks, [&](int k) { ++own[size_t(kTasks * i + k)]; }); });
    });
  for (std::thread& caller : callers) caller.join();
  for (const std::vector<int>& own : counts)
    CHECK(own == std::vector<int>(kTasks * kTasks, kRounds));
  CHECK_THROWS_AS(
      pool.run(kTasks, [&](int) { pool.run(kTasks, [](int) { throw std::runtime_error("!"); }); }),
      std::runtime_error);
  int sum = 0;
  pool.run(1, [&](int) { ++sum; });
  pool.run(kTasks, [](int) {});
  CHECK(sum == 1);
}

namespace {

int threads_of_this_process() {
#ifdef __linux__
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;)
    if (word == "Threads:") {
      int count = 0;
      status >> count;
      return count;
    }
#endif
  return -1;
}

}  // namespace

TEST_CASE("all pools share the process's workers, which end with the last of them", "[threads]") {
  const int before = threads_of_this_process();
  {
    std::vector<std::unique_ptr<Deformer>> idle;
    for (int k = 0; k < 10; ++k) idle.push_back(bound(6, 8, 13));
    if (before > 0) CHECK(threads_of_this_process() <= before + 7);
    const ThreadPool more(10);
    CHECK(more.count() == 10);
    if (before > 0) CHECK(threads_of_this_process() <= before + 9);
  }
  if (before > 0) CHECK(threads_of_this_process() == before);
}

TEST_CASE("callers beyond as many as the workers can serve work alone", "[threads]") {
  // More at once than the workers have rounds: each caller's sum and exception are its own.
  constexpr int kCallers = 40, kTasks = 300;
  std::vector<std::thread> callers;
  std::atomic<int> right{0}, caught{0};
  for (int k = 0; k < kCallers; ++k)
    callers.emplace_back([&, k] {
      ThreadPool pool(4);
      for (int round = 0; round < 20; ++round) {
        std::atomic<int> sum{0};
        pool.run(kTasks, [&](int i) { sum += i; });
        right += sum == kTasks * (kTasks - 1) / 2;
        try {
          pool.run(kTasks, [&](int i) {
            if (i == k) throw std::runtime_error(std::to_string(k));
          });
        } catch (const std::runtime_error& error) {
          caught += error.what() == std::to_string(k);
        }
      }
    });
  for (std::thread& caller : callers) caller.join();
  CHECK(right == 20 * kCallers);
  CHECK(caught == 20 * kCallers);
}
