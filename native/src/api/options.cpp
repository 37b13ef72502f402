// SPDX-License-Identifier: GPL-3.0-or-later
#include "api/options.h"

namespace dd::api {

namespace {

constexpr int kMostExamples = 1000;
constexpr int kUsualRefinement = 4;
constexpr double kUsualRimSmoothing = 0.05;

std::vector<Positions> read_examples(const dd_bind_options& options, size_t vertex_count) {
  require(options.example_count <= kMostExamples,
          "options.example_count is " + std::to_string(options.example_count) + ", more than " +
              std::to_string(kMostExamples) + ".");
  require(options.examples || options.example_count == 0,
          "options.examples is null, but options.example_count is " +
              std::to_string(options.example_count) + ".");
  std::vector<Positions> examples;
  for (size_t i = 0; i < options.example_count; ++i) {
    require_count("options.examples", options.examples, options.example_vertex_count, vertex_count,
                  "vertices each");
    examples.push_back(read_positions(options.examples + 3 * i * vertex_count, vertex_count));
  }
  return examples;
}

enum class HandleTurns { target = 0, free = 1 };
enum class WithDraft { no = 0, yes = 1 };

Positions read_pivots(const dd_update_options& options, size_t handles) {
  if (!is_given("options.pivots", options.pivots, options.pivot_count, handles, "handles"))
    return {};
  const Positions pivots = Eigen::Map<const Positions>(options.pivots, Index(handles), 3);
  for (Index h = 0; h < pivots.rows(); ++h)
    if (!pivots.row(h).allFinite())
      throw Error(Status::argument, "The pivot of handle " + std::to_string(h) + " is not finite.");
  return pivots;
}

std::vector<double> read_limits(const dd_update_options& options) {
  const double* limits = options.example_limits;
  require(limits || options.example_limit_count == 0,
          "options.example_limits is null, but options.example_limit_count is not 0.");
  require(options.example_limit_count <= kMostExamples,
          "options.example_limit_count is more than the examples can be.");
  for (size_t i = 0; i < options.example_limit_count; ++i)
    require(
        limits[2 * i] <= 0 && limits[2 * i + 1] >= 0,
        "The limits of example " + std::to_string(i) + " must be zero or less and zero or more.");
  return {limits, limits + 2 * options.example_limit_count};
}

}  // namespace

BindOptions read_bind_options(const dd_bind_options* given, size_t vertex_count) {
  const dd_bind_options options = read_struct(given);
  BindOptions result;
  result.base_metric = choice("options.base_metric", options.base_metric, BaseMetric::base);
  result.metric_smoothing = number("options.metric_smoothing", options.metric_smoothing, 0);
  result.smoothness =
      static_cast<Smoothness>(number("options.smoothness", options.smoothness,
                                     DD_SMOOTHNESS_CURVATURE_VARIATION, DD_SMOOTHNESS_THIN_PLATE));
  const bool own_topology =
      is_given("options.base_triangles", options.base_triangles, options.base_triangle_count,
               options.base_triangle_count, "triangles");
  require(!own_topology || options.base, "options.base_triangles are given, but no options.base.");
  require(!own_topology || options.base_triangle_count > 0,
          "options.base has no triangles, so nothing can follow it.");
  require(!options.base || options.base_count > 0, "options.base has no vertices.");
  require(options.base_count < kMostElements && options.base_triangle_count < kMostElements,
          "The base has more vertices or triangles than this library can number.");
  result.base = read_optional_positions("options.base", options.base, options.base_count,
                                        own_topology ? options.base_count : vertex_count);
  if (own_topology)
    result.base_triangles = Eigen::Map<const Triangles>(
        options.base_triangles, static_cast<Index>(options.base_triangle_count), 3);
  result.triangulation =
      choice("options.triangulation", options.triangulation, Triangulation::given);
  result.precision = choice("options.precision", options.precision, Precision::full);
  result.threads = threads(options.threads);
  result.examples = read_examples(options, vertex_count);
  return result;
}

bool wants_draft(const dd_bind_options* given) {
  return choice("options.draft", read_struct(given).draft, WithDraft::yes) == WithDraft::yes;
}

Update read_update_options(const dd_update_options* given, const Deformer& deformer) {
  const dd_update_options options = read_struct(given);
  Update result;
  result.options.method = choice("options.method", options.method, MethodKind::examples);
  result.options.base_deformer =
      choice("options.base_deformer", options.base_deformer, BaseDeformer::motions);
  result.options.output = choice("options.output", options.output, Output::base);
  result.values = choice("options.values", options.values, Values::offsets);

  MethodOptions& of_method = result.options.of_method;
  of_method.rotation_only = rotations_only(options.gradients);
  require_between("options.refine", options.refine, DD_NONE, 10000);
  Refined& refined = of_method.refined;
  refined.iterations = options.refine == 0         ? kUsualRefinement
                       : options.refine == DD_NONE ? 0
                                                   : options.refine;
  refined.rim_smoothing =
      options.rim_smoothing == static_cast<double>(DD_NONE)
          ? 0
          : share("options.rim_smoothing", options.rim_smoothing, kUsualRimSmoothing);
  refined.rotation_smoothing =
      share("options.rotation_smoothing", options.rotation_smoothing, refined.rotation_smoothing);
  of_method.levels = number("options.levels", options.levels, 20, of_method.levels);
  of_method.formulation =
      choice("options.formulation", options.formulation, Formulation::fourth_points_unweighted);
  of_method.volume_tolerance =
      number("options.volume_tolerance", options.volume_tolerance, of_method.volume_tolerance);
  of_method.volume_iterations =
      number("options.volume_iterations", options.volume_iterations,
             std::numeric_limits<int32_t>::max(), of_method.volume_iterations);
  require(options.example_weights || options.example_weight_count == 0,
          "options.example_weights is null, but options.example_weight_count is not 0.");
  require(options.example_weight_count <= kMostExamples,
          "options.example_weight_count is more than the examples can be.");
  if (options.example_weights)
    of_method.example_weights.emplace(options.example_weights,
                                      options.example_weights + options.example_weight_count);
  of_method.example_stiffness =
      number("options.example_stiffness", options.example_stiffness, of_method.example_stiffness);
  of_method.example_limits = read_limits(options);

  result.motion.steps = number("options.steps", options.steps, 1000, 1);
  const size_t handles = count_of(deformer.region().handle_count);
  if (is_given("options.turns", options.turns, options.turn_count, handles, "handles"))
    result.options.turns.assign(options.turns, options.turns + 3 * options.turn_count);
  if (is_given("options.handle_turns", options.handle_turns, options.handle_turn_count, handles,
               "handles"))
    for (size_t h = 0; h < handles; ++h)
      result.options.free.push_back(choice("options.handle_turns", options.handle_turns[h],
                                           HandleTurns::free) == HandleTurns::free);
  result.options.pivots = read_pivots(options, handles);
  result.deformed_base = read_optional_positions("options.base", options.base, options.base_count,
                                                 count_of(deformer.base_vertex_count()));
  return result;
}

}  // namespace dd::api
