// SPDX-License-Identifier: GPL-3.0-or-later
// The C ABI: binds, deformers and splits.
#include <atomic>
#include <chrono>
#include <cmath>
#include <limits>
#include <memory>
#include <string>

#include "api/c_api_job.h"
#include "api/c_api_support.h"
#include "deform/deformer.h"
#include "deform/split_motion.h"
#include "kernels/kernels.h"

using namespace dd::c_api;

namespace {

dd::BindOptions read_options(const dd_bind_options* given, size_t position_count) {
  const dd_bind_options options = read_struct("options", given, dd_bind_options{});
  require(
      options.base_metric == DD_METRIC_SURFACE || options.base_metric == DD_METRIC_BASE,
      "options.base_metric is " + std::to_string(options.base_metric) + ", which is no metric.");
  require(options.metric_smoothing >= 0 && std::isfinite(options.metric_smoothing),
          "options.metric_smoothing must be zero or more.");
  require(options.smoothness >= DD_SMOOTHNESS_DEFAULT &&
              options.smoothness <= DD_SMOOTHNESS_CURVATURE_VARIATION,
          "options.smoothness is " + std::to_string(options.smoothness) + ", not 1, 2 or 3.");
  const int smoothness =
      options.smoothness == DD_SMOOTHNESS_DEFAULT ? DD_SMOOTHNESS_THIN_PLATE : options.smoothness;
  require(options.precision == DD_PRECISION_SINGLE || options.precision == DD_PRECISION_DOUBLE,
          "options.precision is " + std::to_string(options.precision) + ", not single or double.");
  require(options.threads >= 0 && options.threads <= 1024,
          "options.threads is " + std::to_string(options.threads) + ", not between 0 and 1024.");
  return {static_cast<dd::BaseMetric>(options.base_metric),
          options.metric_smoothing,
          static_cast<dd::Smoothness>(smoothness),
          read_base(options.base, options.base_count, position_count),
          options.precision == DD_PRECISION_SINGLE ? dd::Precision::single : dd::Precision::full,
          options.threads,
          read_examples(options, position_count)};
}

dd_update_options read_options(const dd_update_options* given) {
  dd_update_options options = read_struct(
      "options", given,
      dd_update_options{sizeof(dd_update_options), 1, DD_OUTPUT_POSITIONS, DD_METHOD_TRANSFER, 4,
                        DD_SHOWN_RESULT, 1, nullptr, 0, 0, 0, 0, nullptr, 0, 0});
  require(options.rotation_only == 0 || options.rotation_only == 1,
          "options.rotation_only must be 0 or 1.");
  require(options.output == DD_OUTPUT_POSITIONS || options.output == DD_OUTPUT_OFFSETS,
          "options.output is " + std::to_string(options.output) + ", which is no output.");
  require(options.method >= DD_METHOD_TRANSFER && options.method <= DD_METHOD_EXAMPLES,
          "options.method is " + std::to_string(options.method) + ", which is no method.");
  require(options.refine >= 0 && options.refine <= 10000,
          "options.refine is " + std::to_string(options.refine) + ", not between 0 and 10000.");
  require(options.shown == DD_SHOWN_RESULT || options.shown == DD_SHOWN_BASE,
          "options.shown is " + std::to_string(options.shown) + ", not result or base.");
  require(options.levels >= 0 && options.levels <= 20,
          "options.levels is " + std::to_string(options.levels) + ", not between 1 and 20.");
  require(options.volume_tolerance >= 0 && std::isfinite(options.volume_tolerance),
          "options.volume_tolerance must be zero or more.");
  require(options.volume_iterations >= 0,
          "options.volume_iterations is " + std::to_string(options.volume_iterations) + ".");
  require(options.formulation >= DD_FORMULATION_SURFACE &&
              options.formulation <= DD_FORMULATION_FOURTH_POINTS_UNWEIGHTED,
          "options.formulation is " + std::to_string(options.formulation) + ", which is none.");
  require(options.example_weights || options.example_weight_count == 0,
          "options.example_weights is null, but options.example_weight_count is not 0.");
  require(options.example_stiffness >= 0 && std::isfinite(options.example_stiffness),
          "options.example_stiffness must be zero or more.");
  const dd::MethodOptions defaults;
  if (options.example_stiffness == 0) options.example_stiffness = defaults.example_stiffness;
  if (options.levels == 0) options.levels = defaults.levels;
  if (options.volume_tolerance == 0) options.volume_tolerance = defaults.volume_tolerance;
  if (options.volume_iterations == 0) options.volume_iterations = defaults.volume_iterations;
  return options;
}

}  // namespace

namespace {

/// What a bind is made from, checked and copied.
struct BindInput {
  dd::Mesh mesh;
  std::vector<int> roles;
  int32_t handle_count;
  dd::BindOptions options;
};

BindInput read_bind_input(const float* positions, size_t position_count, const int32_t* triangles,
                          size_t triangle_index_count, const int32_t* roles, size_t role_count,
                          int32_t handle_count, const dd_bind_options* options) {
  require(roles || role_count == 0, "roles is null.");
  dd::Mesh mesh = read_mesh(positions, position_count, triangles, triangle_index_count);
  require_size("roles", role_count, position_count / 3);
  return {std::move(mesh), std::vector<int>(roles, roles + role_count), handle_count,
          read_options(options, position_count)};
}

dd::UpdateOptions update_options(const dd_update_options& how) {
  dd::UpdateOptions options{static_cast<dd::MethodKind>(how.method),
                            {how.rotation_only == 1,
                             how.refine,
                             how.levels,
                             how.volume_tolerance,
                             how.volume_iterations,
                             static_cast<dd::Formulation>(how.formulation),
                             {}},
                            static_cast<dd::Shown>(how.shown)};
  if (how.example_weights)
    options.of_method.example_weights.emplace(how.example_weights,
                                              how.example_weights + how.example_weight_count);
  options.of_method.example_stiffness = how.example_stiffness;
  return options;
}

/// Positions or offsets as floats; refuses what leaves their range.
void write_result(const dd::Positions& rest, const dd::Positions& offsets, int32_t output,
                  float* out) {
  const double largest = std::max(offsets.cwiseAbs().maxCoeff(), rest.cwiseAbs().maxCoeff());
  if (!(largest < 0.5 * std::numeric_limits<float>::max())) throw dd::leaves_single_precision();
  Eigen::Map<FloatRows> result(out, offsets.rows(), 3);
  if (output == DD_OUTPUT_OFFSETS)
    result = offsets.cast<float>();
  else
    result = (rest + offsets).cast<float>();
}

}  // namespace

struct dd_deformer {
  template <class... Arguments>
  explicit dd_deformer(Arguments&&... arguments)
      : deformer(std::forward<Arguments>(arguments)...) {}
  dd::Deformer deformer;
  double bind_seconds = 0;
  std::atomic<bool> busy{false};
};

// The job comes last: it is joined before what it writes to is gone.
struct dd_bind {
  std::unique_ptr<dd_deformer> result;
  Job job;
};

struct dd_split {
  dd::Positions rest;
  dd::SplitResult result;
  int32_t output = DD_OUTPUT_POSITIONS;
  Job job;
};

extern "C" {

int32_t dd_abi_version(void) { return DD_ABI_VERSION; }

const char* dd_version(void) { return DD_VERSION; }

const char* dd_instruction_set(void) { return dd::kernels().name; }

const char* dd_last_message(void) { return last_message; }

int32_t dd_bind_start(const float* positions, size_t position_count, const int32_t* triangles,
                      size_t triangle_index_count, const int32_t* roles, size_t role_count,
                      int32_t handle_count, const dd_bind_options* options, dd_bind** bind) {
  return guarded([&] {
    require(bind, "bind is null.");
    BindInput input = read_bind_input(positions, position_count, triangles, triangle_index_count,
                                      roles, role_count, handle_count, options);
    auto started = std::make_unique<dd_bind>();
    started->job.start([&result = started->result,
                        input = std::move(input)](const dd::Progress& progress) mutable {
      const auto start = std::chrono::steady_clock::now();
      result = std::make_unique<dd_deformer>(std::move(input.mesh), input.roles, input.handle_count,
                                             input.options, progress);
      result->bind_seconds =
          std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    });
    *bind = started.release();
  });
}

int32_t dd_bind_poll(dd_bind* bind, dd_bind_progress* progress) {
  return guarded([&] {
    require(bind, "bind is null.");
    bind->job.poll(progress);
  });
}

int32_t dd_bind_cancel(dd_bind* bind) {
  return guarded([&] {
    require(bind, "bind is null.");
    bind->job.cancel();
  });
}

int32_t dd_bind_finish(dd_bind* bind, dd_deformer** deformer) {
  return guarded([&] {
    require(bind, "bind is null.");
    require(deformer, "deformer is null.");
    bind->job.finish();
    require(bind->result != nullptr, "The deformer of this bind was taken already.");
    *deformer = bind->result.release();
  });
}

void dd_bind_free(dd_bind* bind) { delete bind; }

int32_t dd_deformer_update(dd_deformer* deformer, const double* matrices, size_t matrix_value_count,
                           const dd_update_options* options, float* out, size_t out_count) {
  return guarded([&] {
    require(deformer, "deformer is null.");
    require(matrices || matrix_value_count == 0, "matrices is null.");
    require(out, "out is null.");
    const InUse in_use(deformer->busy, "deformer");
    dd::Deformer& bound = deformer->deformer;
    require_size("matrices", matrix_value_count,
                 12 * static_cast<size_t>(bound.region().handle_count));
    require_size("out", out_count, 3 * static_cast<size_t>(bound.mesh().vertex_count()));
    const dd_update_options how = read_options(options);
    const dd::Positions base = read_base(how.base, how.base_count, out_count);
    bound.update_to(out, how.output == DD_OUTPUT_POSITIONS, matrices, update_options(how),
                    base.size() ? &base : nullptr);
  });
}

int32_t dd_split_start(const float* positions, size_t position_count, const int32_t* triangles,
                       size_t triangle_index_count, const int32_t* roles, size_t role_count,
                       int32_t handle_count, const dd_bind_options* options, const double* matrices,
                       size_t matrix_value_count, const double* turns, size_t turn_count,
                       int32_t steps, const dd_update_options* update, dd_split** split) {
  return guarded([&] {
    require(split, "split is null.");
    require(matrices || matrix_value_count == 0, "matrices is null.");
    BindInput input = read_bind_input(positions, position_count, triangles, triangle_index_count,
                                      roles, role_count, handle_count, options);
    const size_t handles = static_cast<size_t>(std::max(handle_count, 0));
    require_size("matrices", matrix_value_count, 12 * handles);
    require_size("turns", turn_count, turns ? 3 * handles : 0);
    require(steps >= 1 && steps <= 1000,
            "steps is " + std::to_string(steps) + ", not between 1 and 1000.");
    const dd_update_options how = read_options(update);
    dd::SplitMotion motion;
    motion.matrices.assign(matrices, matrices + matrix_value_count);
    if (turns) motion.turns.assign(turns, turns + turn_count);
    motion.steps = steps;
    auto started = std::make_unique<dd_split>();
    started->rest = input.mesh.positions;
    started->output = how.output;
    started->job.start(
        [&result = started->result, input = std::move(input), motion = std::move(motion),
         options = update_options(how),
         base = read_base(how.base, how.base_count, position_count)](const dd::Progress& progress) {
          result = dd::split_update(input.mesh, input.roles, input.handle_count, input.options,
                                    motion, options, progress, base.size() ? &base : nullptr);
        });
    *split = started.release();
  });
}

int32_t dd_split_poll(dd_split* split, dd_bind_progress* progress) {
  return guarded([&] {
    require(split, "split is null.");
    split->job.poll(progress);
  });
}

int32_t dd_split_cancel(dd_split* split) {
  return guarded([&] {
    require(split, "split is null.");
    split->job.cancel();
  });
}

int32_t dd_split_finish(dd_split* split, float* out, size_t out_count) {
  return guarded([&] {
    require(split, "split is null.");
    require(out, "out is null.");
    split->job.finish();
    require_size("out", out_count, static_cast<size_t>(split->result.offsets.size()));
    write_result(split->rest, split->result.offsets, split->output, out);
  });
}

int32_t dd_split_get_info(const dd_split* split, dd_split_info* info) {
  return guarded([&] {
    require(split, "split is null.");
    dd_split_info facts{};
    facts.volumes_settled = split->result.volumes_settled;
    facts.volume_error = split->result.volume_error;
    write_struct("info", info, facts);
  });
}

void dd_split_free(dd_split* split) { delete split; }

int32_t dd_deformer_get_info(const dd_deformer* deformer, dd_deformer_info* info) {
  return guarded([&] {
    require(deformer, "deformer is null.");
    const dd::Deformer& bound = deformer->deformer;
    const dd::Region& region = bound.region();
    const auto& degenerate = bound.degenerate_triangles();
    dd_deformer_info facts{};
    facts.vertex_count = bound.mesh().vertex_count();
    facts.triangle_count = bound.mesh().triangle_count();
    facts.handle_count = region.handle_count;
    facts.free_count = region.free_count();
    facts.resting_count = region.resting_count;
    facts.resting_part_count = region.resting_part_count;
    facts.resting_example = region.resting_example;
    facts.loose_count = region.loose_count;
    facts.loose_example = region.loose_example;
    facts.idle_handle_count = static_cast<int32_t>(region.idle_handles.size());
    facts.idle_handle_example = region.idle_handles.empty() ? -1 : region.idle_handles.front();
    facts.degenerate_count = static_cast<int32_t>(degenerate.size());
    facts.degenerate_example = degenerate.empty() ? -1 : degenerate.front();
    facts.borrowed_count = bound.findings(dd::MethodKind::transfer).stand_in_count;
    const dd::MethodFindings normal = bound.findings(dd::MethodKind::normal);
    facts.unrepresented_count = normal.unrepresented_count;
    facts.unrepresented_example = normal.unrepresented_example;
    facts.bind_seconds = deformer->bind_seconds;
    facts.bytes = bound.bytes();
    write_struct("info", info, facts);
  });
}

int32_t dd_deformer_get_example_weights(const dd_deformer* deformer, double* out, size_t count) {
  return guarded([&] {
    require(deformer, "deformer is null.");
    require(out || count == 0, "out is null.");
    const std::vector<double> weights =
        deformer->deformer.findings(dd::MethodKind::examples).example_weights;
    require_size("out", count, weights.size());
    std::copy(weights.begin(), weights.end(), out);
  });
}

void dd_deformer_free(dd_deformer* deformer) { delete deformer; }

}  // extern "C"
