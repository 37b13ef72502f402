// SPDX-License-Identifier: GPL-3.0-or-later
// The C ABI where an allocation or a thread start fails: it returns a status and a message, leaves
// outputs untouched and no memory behind, and the next call gives the right result.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "catch.h"
#include "failing.h"
#include "flat_mesh.h"
#include "meshes.h"

using namespace dd;
using test::defaults;
using test::Failing;

namespace {

using Floats = std::vector<float>;

/// A mesh as the ABI takes it, with roles.
struct Surface : test::FlatMesh {
  std::vector<int32_t> roles;
  explicit Surface(const Mesh& mesh) : FlatMesh(mesh), roles(roles_of(mesh)) {}

 private:
  static std::vector<int32_t> roles_of(const Mesh& mesh) {
    const std::vector<int> found = test::roles_by_height(mesh, -0.5, 0.7);
    return {found.begin(), found.end()};
  }
};

const Surface& ball() {
  static const Surface made(test::rough_sphere(2, 0.1));
  return made;
}

const Surface& other_ball() {
  static const Surface made(test::rough_sphere(2, 0.1, 8));
  return made;
}

const Surface& cage() {
  static const Surface made(test::sphere(1));
  return made;
}

Floats turned(const Floats& positions) {
  Floats result = positions;
  for (size_t k = 0; k < positions.size(); k += 3) {
    result[k] = positions[k] + 0.4f * positions[k + 2];
    result[k + 1] = 1.2f * positions[k + 1];
  }
  return result;
}

/// 1 for the vertices on one side, .5 next to the middle.
Floats stiff_side(const Surface& surface) {
  Floats weights;
  for (size_t k = 0; k < surface.positions.size(); k += 3)
    weights.push_back(std::clamp(0.5f + 2 * surface.positions[k], 0.0f, 1.0f));
  return weights;
}

constexpr double kLift[12] = {0.9, 0.1, 0, 0, -0.1, 0.9, 0, 0, 0, 0, 1, 0.3};
constexpr float kUntouched = -77;

dd_bind_options bind_options(int threads) {
  dd_bind_options options = detail_deform::defaults(dd_bind_options_init);
  options.threads = threads;
  return options;
}

const dd_refinement_options* refined(int iterations) {
  static std::map<int, dd_refinement_options> made;
  dd_refinement_options& options = made[iterations];
  options = detail_deform::defaults(dd_refinement_options_init);
  options.iterations = iterations;
  return &options;
}

dd_update_options update_options(dd_method method, int iterations = 0) {
  dd_update_options options = detail_deform::defaults(dd_update_options_init);
  options.method = method;
  options.refinement = refined(iterations);
  return options;
}

int32_t bind(const dd_bind_options& options, dd_deformer** deformer) {
  const dd_mesh mesh = ball().mesh();
  dd_job* job = nullptr;
  int32_t status =
      dd_deformer_bind_start(&mesh, ball().roles.data(), mesh.vertices.count, 1, &options, &job);
  if (status == DD_OK) status = dd_job_take_deformer(job, deformer);
  dd_job_free(job);
  return status;
}

/// Runs a call in which allocations or thread starts may fail.
using Fallible = std::function<int32_t(const std::function<int32_t()>& call)>;
/// One use of the ABI, from the making of its arguments to the freeing of its results.
struct Work {
  std::string name;
  /// Returns the status of its calls, with out as they left it. `fallible` runs those under test.
  std::function<int32_t(Floats& out, const Fallible& fallible)> run;
};

/// A bind and one update.
Work bound(std::string name, dd_bind_options options) {
  return {std::move(name), [=](Floats& out, const Fallible& fallible) {
            dd_deformer* deformer = nullptr;
            int32_t status = fallible([&] { return bind(options, &deformer); });
            if (status == DD_OK) {
              const dd_update_options how = update_options(DD_METHOD_DETAIL);
              const dd_points_out to = detail_deform::points_out(out);
              status = dd_deformer_update(deformer, kLift, 1, &how, &to);
            }
            dd_deformer_free(deformer);
            return status;
          }};
}

/// The first update by a method after a bind without faults. A refused one is repeated, and must
/// equal the update of a fresh deformer.
Work updated(std::string name, dd_update_options how, dd_bind_options options = bind_options(2)) {
  return {std::move(name), [=](Floats& out, const Fallible& fallible) {
            dd_deformer* deformer = nullptr;
            int32_t status = bind(options, &deformer);
            const auto update = [&](Floats& result) {
              const dd_points_out to = detail_deform::points_out(result);
              return dd_deformer_update(deformer, kLift, 1, &how, &to);
            };
            if (status == DD_OK) status = fallible([&] { return update(out); });
            if (status != DD_OK) {
              const std::string sentence = dd_last_message();
              Floats again(out.size()), fresh(out.size());
              const int32_t second = update(again);
              dd_deformer_free(deformer);
              deformer = nullptr;
              const int32_t anew = bind(options, &deformer);
              const int32_t third = update(fresh);
              if (second != DD_OK || anew != DD_OK || third != DD_OK || again != fresh)
                status = DD_ERROR_INTERNAL;
            }
            dd_deformer_free(deformer);
            return status;
          }};
}

std::vector<Work> works() {
  static const Floats examples = turned(ball().positions);
  std::vector<Work> all;
  for (int threads : {1, 2})
    all.push_back(bound("bind with threads: " + std::to_string(threads), bind_options(threads)));
  dd_bind_options how = bind_options(2);
  how.base_metric = DD_METRIC_BASE;
  how.precision = DD_PRECISION_DOUBLE;
  how.smoothness = DD_SMOOTHNESS_CURVATURE_VARIATION;
  all.push_back(bound("bind, energy on the base", how));
  how = bind_options(1);
  how.metric_smoothing = 1;
  all.push_back(bound("bind on a smoothed surface", how));

  all.push_back(updated("transfer, refined", update_options(DD_METHOD_DETAIL, 2)));
  static const Floats stiff = stiff_side(ball());
  how = bind_options(2);
  how.stiffness = stiff.data();
  how.stiffness_count = stiff.size();
  all.push_back(updated("stiff parts", update_options(DD_METHOD_DETAIL, 2), how));
  for (int formulation : {1, 2}) {
    dd_update_options fourth = update_options(DD_METHOD_DETAIL);
    fourth.formulation = static_cast<dd_formulation>(formulation);
    all.push_back(updated("transfer by fourth points " + std::to_string(formulation), fourth));
  }
  all.push_back(updated("variational", update_options(DD_METHOD_VARIATIONAL)));
  dd_update_options levels = update_options(DD_METHOD_NORMAL);
  static dd_normal_options two_levels = detail_deform::defaults(dd_normal_options_init);
  two_levels.levels = 2;
  levels.normal = &two_levels;
  all.push_back(updated("normal displacement", levels));
  all.push_back(updated("gradient editing", update_options(DD_METHOD_GRADIENT)));
  dd_update_options volumes = update_options(DD_METHOD_VOLUMES);
  static dd_volumes_options twice = detail_deform::defaults(dd_volumes_options_init);
  twice.iterations = 2;
  volumes.volumes = &twice;
  all.push_back(updated("displacement volumes", volumes));
  how = bind_options(2);
  static const dd_points example = detail_deform::points(examples);
  how.examples = &example;
  how.example_count = 1;
  all.push_back(updated("examples", update_options(DD_METHOD_EXAMPLES), how));
  static const double weight = 0.5;
  dd_update_options given = update_options(DD_METHOD_EXAMPLES);
  static dd_examples_options by_weight = detail_deform::defaults(dd_examples_options_init);
  by_weight.weights = &weight;
  by_weight.weight_count = 1;
  given.examples = &by_weight;
  all.push_back(updated("examples by weights", given, how));
  static const int32_t freely = DD_HANDLE_TURNS_FREE;
  for (dd_method method : {DD_METHOD_DETAIL, DD_METHOD_EXAMPLES}) {
    dd_update_options placed = update_options(method);
    placed.handle_turns = &freely;
    placed.handle_turn_count = 1;
    all.push_back(updated("a handle that only places, " + std::to_string(method), placed, how));
  }
  how = bind_options(2);
  static const Floats cage_moved = turned(cage().positions);
  static const dd_points cage_rest = detail_deform::points(cage().positions),
                         cage_now = detail_deform::points(cage_moved);
  how.base = &cage_rest;
  how.base_triangles = cage().triangles.data();
  how.base_triangle_count = cage().triangles.size() / 3;
  dd_update_options carried = update_options(DD_METHOD_DETAIL);
  carried.base = &cage_now;
  all.push_back(updated("a cage", carried, how));

  all.push_back({"in steps", [](Floats& out, const Fallible& fallible) {
                   dd_update_options in_steps = update_options(DD_METHOD_DETAIL);
                   in_steps.steps = 2;
                   dd_deformer* deformer = nullptr;
                   dd_job* job = nullptr;
                   const dd_points_out to = detail_deform::points_out(out);
                   const int32_t result = fallible([&] {
                     int32_t status = bind(bind_options(2), &deformer);
                     if (status == DD_OK)
                       status = dd_deformer_update_start(deformer, kLift, 1, &in_steps, &job);
                     if (status == DD_OK) status = dd_job_get_update(job, &to);
                     return status;
                   });
                   dd_job_free(job);
                   dd_deformer_free(deformer);
                   return result;
                 }});
  for (const auto& [formulation, pairs_of] :
       {std::pair{0, 0}, {1, 0}, {0, int(DD_PAIRS_OF_NEAREST)}})
    all.push_back(
        {"transfer between meshes " + std::to_string(formulation + pairs_of),
         [=, formulation = formulation, pairs_of = pairs_of](Floats& out,
                                                             const Fallible& fallible) {
           const dd_mesh source = ball().mesh(), target = other_ball().mesh();
           const Floats pose = turned(ball().positions);
           dd_transfer_options options = detail_deform::defaults(dd_transfer_options_init);
           options.threads = 2;
           options.formulation = static_cast<dd_formulation>(formulation);
           options.pairs_of = static_cast<dd_pairs_of>(pairs_of);
           const dd_points posed = detail_deform::points(pose);
           const dd_points_out to = {out.data(), target.vertices.count, 3 * sizeof(float)};
           options.placing = DD_PLACING_VERTICES;
           dd_job* job = nullptr;
           dd_transfer* transfer = nullptr;
           const int32_t result = fallible([&] {
             int32_t status = dd_transfer_start(&source, &target, nullptr, 0, &options, &job);
             if (status == DD_OK) status = dd_job_take_transfer(job, &transfer);
             if (status == DD_OK) status = dd_transfer_apply(transfer, &posed, nullptr, &to);
             return status;
           });
           dd_job_free(job);
           dd_transfer_free(transfer);
           return result;
         }});
  for (const size_t marker_count : {6, 0})
    all.push_back(
        {"match by markers: " + std::to_string(marker_count),
         [=](Floats& out, const Fallible& fallible) {
           const dd_mesh source = ball().mesh(), target = other_ball().mesh();
           const std::vector<int32_t> markers = {0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5};
           dd_match_options options = detail_deform::defaults(dd_match_options_init);
           const dd_points_out to = {out.data(), source.vertices.count, 3 * sizeof(float)};
           options.threads = 2;
           options.stages = options.rounds = 1;
           dd_job* job = nullptr;
           dd_match* match = nullptr;
           const int32_t result = fallible([&] {
             int32_t status =
                 dd_match_start(&source, &target, markers.data(), marker_count, &options, &job);
             if (status == DD_OK) status = dd_job_take_match(job, &match);
             if (status == DD_OK) status = dd_match_get_positions(match, &to);
             return status;
           });
           dd_job_free(job);
           dd_match_free(match);
           return result;
         }});
  all.push_back({"distances", [](Floats& out, const Fallible& fallible) {
                   const dd_mesh mesh = ball().mesh();
                   std::vector<int32_t> sources(mesh.vertices.count, 0);
                   sources[0] = 1;
                   return fallible([&] {
                     return dd_mesh_distances(&mesh, sources.data(), sources.size(), out.data(),
                                              sources.size());
                   });
                 }});
  all.push_back({"vertex gradients", [](Floats& out, const Fallible& fallible) {
                   const dd_mesh mesh = ball().mesh();
                   const Floats now = turned(ball().positions);
                   Floats found(9 * mesh.vertices.count, out[0]);
                   const dd_points deformed = detail_deform::points(now);
                   const int32_t status = fallible([&] {
                     return dd_mesh_vertex_gradients(&mesh, &deformed, found.data(),
                                                     mesh.vertices.count);
                   });
                   std::copy_n(found.begin(), std::min(found.size(), out.size()), out.begin());
                   return status;
                 }});
  all.push_back({"riders", [](Floats& out, const Fallible& fallible) {
                   const dd_mesh mesh = ball().mesh();
                   const auto last = static_cast<int32_t>(mesh.vertices.count) - 1;
                   std::vector<int32_t> contacts;
                   for (int32_t t = 0; t < static_cast<int32_t>(mesh.triangle_count); ++t)
                     if (std::count(mesh.triangles + 3 * t, mesh.triangles + 3 * t + 3, last) == 0)
                       contacts.insert(contacts.end(), {0, t});
                   const std::vector<int32_t> rider = {last, 0};
                   const double size = 0.1;
                   const Floats now = turned(ball().positions);
                   const dd_points offsets = detail_deform::points(now);
                   const dd_points_out to = {out.data(), mesh.vertices.count, 3 * sizeof(float)};
                   dd_riders_options options = detail_deform::defaults(dd_riders_options_init);
                   options.threads = 2;
                   options.riders = rider.data();
                   options.rider_count = 1;
                   options.contacts = contacts.data();
                   options.contact_count = contacts.size() / 2;
                   options.sizes = &size;
                   options.group_count = 1;
                   dd_riders* riders = nullptr;
                   const int32_t status = fallible([&] {
                     const int32_t made = dd_riders_make(&mesh, &options, &riders);
                     return made == DD_OK ? dd_riders_place(riders, &offsets, &to) : made;
                   });
                   dd_riders_free(riders);
                   return status;
                 }});
  all.push_back({"measures", [](Floats& out, const Fallible& fallible) {
                   const dd_mesh mesh = ball().mesh();
                   const Floats now = turned(ball().positions);
                   const dd_points deformed = detail_deform::points(now);
                   auto options = defaults<dd_measure_options>();
                   options.base = &mesh.vertices;
                   options.deformed_base = &deformed;
                   auto measures = defaults<dd_measures>();
                   const int32_t status = fallible([&] {
                     return dd_mesh_measure(&mesh, ball().roles.data(), mesh.vertices.count,
                                            &deformed, &options, &measures);
                   });
                   if (status == DD_OK) out[0] = static_cast<float>(measures.stretch);
                   return status;
                 }});
  return all;
}

/// Describes a failure of the ABI's promises under faults; empty if they are kept.
std::string complaint(const Work& work, const Floats& expected, Failing::What what, long first,
                      long last) {
  const long before = test::living_allocations();
  std::string found;
  {
    Floats out(expected.size(), kUntouched);
    bool failed = false;
    char sentence[256] = "";
    dd_job_poll(nullptr, nullptr);  // leaves another message than the faults do
    const int32_t status = work.run(out, [&](const std::function<int32_t()>& call) {
      const Failing failing(what, first, last);
      const int32_t of_call = call();
      failed = Failing::failed();
      std::strncpy(sentence, dd_last_message(), sizeof sentence - 1);
      return of_call;
    });
    if (status == DD_OK && out != expected) found = "other results";
    if (status != DD_OK && !failed) found = "refused without a reason";
    if (status != DD_OK && status != DD_ERROR_MEMORY)
      found = "the status " + std::to_string(status) + ": " + sentence;
    if (status != DD_OK && std::strlen(sentence) < 20) found = "no sentence";
    if (status != DD_OK && out != Floats(out.size(), kUntouched)) found = "outputs written";
  }
  // `found` allocates beyond the 15 characters that a string holds inside.
  const long leaked = test::living_allocations() - before - (found.capacity() > 15 ? 1 : 0);
  if (found.empty() && leaked != 0) found = std::to_string(leaked) + " allocations kept";
  return found;
}

/// Results without a fault, and how many allocations or threads the fallible call asks for.
Floats expected_of(const Work& work, Failing::What what, long& asked) {
  Floats out(ball().positions.size(), kUntouched);
  for (int twice = 0; twice < 2; ++twice) {  // counts in the second run: some memory is kept
    const int32_t status = work.run(out, [&](const std::function<int32_t()>& call) {
      const Failing counting(what, Failing::kNever);
      const int32_t of_call = call();
      asked = Failing::asked();
      return of_call;
    });
    REQUIRE(status == DD_OK);
  }
  return out;
}

}  // namespace

TEST_CASE("whichever allocation fails, the C ABI says so, keeps nothing and goes on") {
  for (const Work& work : works()) {
    long asked = 0;
    const Floats expected = expected_of(work, Failing::allocations, asked);
    INFO(work.name << ", " << asked << " allocations");
    REQUIRE(asked > 10);
    // Each of the first 60, in which arguments are read and threads started; then some 150 more.
    const long step = std::max(1L, asked / 150);
    for (long k = 0; k < asked; k += k < 60 ? 1 : step) {
      const std::string found = complaint(work, expected, Failing::allocations, k, k);
      INFO("allocation " << k << ": " << found);
      CHECK(found.empty());
    }
  }
}

TEST_CASE("whichever thread can't be started, work is done by fewer or refused in a sentence") {
  constexpr long kAllFollowing = 1 << 20;
  for (const Work& work : works()) {
    long asked = 0;
    const Floats expected = expected_of(work, Failing::threads, asked);
    INFO(work.name << ", " << asked << " threads");
    for (long k = 0; k < asked; ++k)
      for (long last : {k, kAllFollowing}) {
        const std::string found = complaint(work, expected, Failing::threads, k, last);
        INFO("threads " << k << " to " << last << ": " << found);
        CHECK(found.empty());
      }
  }
}
